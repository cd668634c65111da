// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening/screening.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/selection/screening/effect_search.h"
#include "render_worker/diagnosis/selection/screening/flicker_search.h"
#include "render_worker/diagnosis/selection/screening/fringe_search.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

ActiveEffect AtNullValues(const Effect& effect) {
  ActiveEffect active{&effect, {}};
  for (const EffectParameter& p : effect.description().parameters) {
    active.parameters.push_back(p.null_value);
  }
  return active;
}

Screening::Screening(const SetModel& model, const FitResult& base, std::vector<bool> use_block)
    : model_(model),
      base_(base),
      linear_(base, use_block),
      base_middle_(model.Expect(base.parameters, false, true).mean) {
  if (std::find(base.at_bound.begin(), base.at_bound.end(), true) == base.at_bound.end()) return;
  released_.emplace(base, std::move(use_block), LinearFit::ActiveBounds::kReleased);
  released_residual_ = released_->ResidualAtBest();
}

ScreenedEffect Screening::Screen(const Effect& effect) const {
  return SearchEffect(*this, effect, StartsOf(effect));
}

// A fit of a periodic effect cannot move from one period to another: it starts at the peaks of a
// periodogram.
std::vector<ActiveEffect> Screening::StartsOf(const Effect& effect) const {
  switch (effect.description().start_search) {
    case StartSearch::kGrid:
      return {};
    case StartSearch::kPeriodogramOfSensor:
      return FringesSeen(effect, model_.set());
    case StartSearch::kPeriodogramOfTime:
      break;
  }
  ActiveEffect steady = AtNullValues(effect);
  steady.parameters[0] =
      ParameterFromStandardised(effect.description().parameters[0], thresholds::kProbe);
  steady.parameters[1] = 0;
  // The light is reduced until its change is linear.
  Eigen::VectorXd change = ChangeOf(steady);
  for (int turn = 0; turn < 3 && change.squaredNorm() > 10 * thresholds::kLinearLength; ++turn) {
    steady.parameters[0] *= std::sqrt(thresholds::kLinearLength / change.squaredNorm());
    change = ChangeOf(steady);
  }
  return FlickerSeen(effect, model_, base_, change, steady.parameters[0]);
}

Eigen::VectorXd Screening::ChangeOf(const ActiveEffect& active, bool middle_only) const {
  SetParameters parameters = base_.parameters;
  parameters.effects.push_back(active);
  BlockVectors mean = model_.Expect(parameters, false, middle_only).mean;
  for (size_t e = 0; middle_only && e < mean.size(); ++e) {
    mean[e] += base_.mean[e] - base_middle_[e];
  }
  return linear_.Change(mean);
}

}  // namespace sightline
