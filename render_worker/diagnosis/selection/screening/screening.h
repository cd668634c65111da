// SPDX-License-Identifier: Apache-2.0
// Screening: expected gains of single effects, by the model's expectations and a fit linearised at
// its parameters. Screening takes a few expectations of the set per effect, a fit hundreds. The
// model comparison starts from the results.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/linear_fit.h"

namespace sightline {

struct ScreenedEffect {
  ActiveEffect strongest;  // the parameters of largest gain; any, if nothing gains
  Eigen::VectorXd change;  // of the whitened expectation there
  double gain = 0;         // in log-likelihood [nats]
  // Gain if the model were linear and parameters at their bounds were free [nats]. If it is much
  // larger than `gain`, the set-up's parameters have absorbed the effect, and both must be fitted
  // together.
  double linear_gain = 0;
  ActiveEffect linear_best;
  // The first parameter that has an effect by itself, and its standardised value at an expected
  // gain of 5 nats; 0: the recordings cannot show it.
  int parameter = 0;
  double detectable = 0;
};

// The effect with all parameters at their null values.
ActiveEffect AtNullValues(const Effect& effect);

class Screening {
 public:
  // `model` and `base` must outlive it. `base`: the fit that an effect is added to. Observation
  // blocks not in `use_block` (empty: all) are left out.
  Screening(const SetModel& model, const FitResult& base, std::vector<bool> use_block = {});

  // Searches from a few strengths and shapes. `effect` must change the expectation: random effects
  // per recording do not.
  ScreenedEffect Screen(const Effect& effect) const;

  // Whitened change of the base's expectation. `middle_only`: computed in the middle of the line
  // and taken to be alike elsewhere, in a fraction of the time.
  Eigen::VectorXd ChangeOf(const ActiveEffect& active, bool middle_only = false) const;

  const LinearFit& linear() const { return linear_; }
  // The linearised fit with parameters at their bounds set free, and its residual at the best
  // parameters; nullptr: no bound is active.
  const LinearFit* released() const { return released_ ? &*released_ : nullptr; }
  const Eigen::VectorXd& released_residual() const { return released_residual_; }

 private:
  // Starts from a periodogram of the recordings, for effects that need one.
  std::vector<ActiveEffect> StartsOf(const Effect& effect) const;

  const SetModel& model_;
  const FitResult& base_;
  LinearFit linear_;
  std::optional<LinearFit> released_;
  Eigen::VectorXd released_residual_;
  BlockVectors base_middle_;  // expectation by the middle of the line only
};

}  // namespace sightline
