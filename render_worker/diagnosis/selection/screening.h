// SPDX-License-Identifier: Apache-2.0
// What single effects can do to a set's expectation, from a fit linearised: where the competition
// starts from.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/linear_fit.h"

namespace sightline {

struct ScreenedEffect {
  ActiveEffect strongest;  // where the recordings fit best, about; any, if they do not
  Eigen::VectorXd change;  // there, whitened
  double gain = 0;         // in log-likelihood [nats]
  // If everything were linear, and deviations that are held at a bound were free. Much more than
  // `gain`: the base's deviations have taken the effect's place, and both must move together.
  double linear_gain = 0;
  ActiveEffect linear_best;
  // Standardised strength of its first parameter that has one, at which the expected gain is 5.
  int parameter = 0;
  double detectable = 0;  // 0: the recordings do not show it
};

// With all parameters at their null values.
ActiveEffect AtNullValues(const Effect& effect);

class Screening {
 public:
  // Both must outlive it. `base`: the null model, or a fit of effects that others are to be added
  // to. Entries not in `use_entry` (empty: all) count nothing.
  Screening(const SetModel& model, const FitResult& base, std::vector<bool> use_entry = {});

  // From a few strengths and shapes. Not for what is drawn anew for every recording, which changes
  // no expectation.
  ScreenedEffect Screen(const Effect& effect) const;

  // Whitened change of the base's expectation. `middle_only`: as if the whole line were like
  // its middle; a fraction of the time.
  Eigen::VectorXd ChangeOf(const ActiveEffect& active, bool middle_only = false) const;

  const LinearFit& linear() const { return linear_; }
  // As if nothing were held at a bound; nullptr: nothing is.
  const LinearFit* released() const { return released_ ? &*released_ : nullptr; }
  const Eigen::VectorXd& released_residual() const { return released_residual_; }  // at its best

 private:
  // Where the recordings themselves show it.
  std::vector<ActiveEffect> Seen(const Effect& effect) const;

  const SetModel& model_;
  const FitResult& base_;
  LinearFit linear_;
  std::optional<LinearFit> released_;
  Eigen::VectorXd released_residual_;
  Entries base_middle_;  // expected if the whole line were like its middle
};

}  // namespace sightline
