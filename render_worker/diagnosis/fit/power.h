// SPDX-License-Identifier: Apache-2.0
// Power of a set of recordings: how strongly it could show an effect, before it is evaluated or
// even recorded.
#pragma once

#include <memory>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// The null model of a set, linearised at given parameters without effects. A change caused by an
// effect counts only as far as the deviations, within their uncertainties, cannot cause the same.
class NullInformation {
 public:
  // `set` may be planned only, without images. It must outlive this.
  NullInformation(const RecordedSet& set, const SetModelSettings& settings,
                  const SetParameters& parameters);
  ~NullInformation();

  // Expected gain in log-likelihood [nats] of the true model over the refitted null model if these
  // effects are present: half the squared norm of the whitened change of the expectation that is
  // left after the deviations have been refitted under their priors. `roughly`: a few iterations
  // only; the result may be too large where the model is far from linear in the deviations.
  double ExpectedGain(const std::vector<ActiveEffect>& effects, bool roughly = false) const;
  // The gain that is left if the model contains the effects `instead`, whose parameters are
  // refitted from the given values. It is near 0 if the recordings cannot distinguish the two.
  double GainLeft(const std::vector<ActiveEffect>& effects,
                  const std::vector<ActiveEffect>& instead) const;

 private:
  double Left(const std::vector<ActiveEffect>& effects, const std::vector<ActiveEffect>& instead,
              int most_renewals) const;

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sightline
