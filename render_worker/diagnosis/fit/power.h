// SPDX-License-Identifier: Apache-2.0
// What a set of recordings could show before it is looked at, or taken.
#pragma once

#include <memory>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// The null model of a set, linearised about `parameters` (without effects): what an effect changes
// counts as far as no deviation within its uncertainty changes the same.
class NullInformation {
 public:
  // `set` may be planned only: no images. Both must outlive this.
  NullInformation(const RecordedSet& set, const SetModelSettings& settings,
                  const SetParameters& parameters);
  ~NullInformation();

  // Expected gain in log-likelihood [nats] of the true model over the refitted null model if these
  // effects are there: half the squared length of the whitened change of the statistics' means,
  // after the best deviations (with their priors) have been refitted.
  // `roughly`: some times faster, may be too large where deviations are far from linear.
  double ExpectedGain(const std::vector<ActiveEffect>& effects, bool roughly = false) const;
  // What is left of it with other effects in the model, all their parameters refitted from these
  // values on: near 0 if the recordings cannot tell the two apart.
  double GainLeft(const std::vector<ActiveEffect>& effects,
                  const std::vector<ActiveEffect>& instead) const;

 private:
  double Left(const std::vector<ActiveEffect>& effects, const std::vector<ActiveEffect>& instead,
              int most_renewals) const;

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sightline
