// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

std::vector<const Effect*> EquivalenceClass(const Context& context, const Screening& about_null,
                                            const std::vector<Hypothesis>& ranked) {
  std::vector<const Effect*> same;
  const Hypothesis& best = ranked.front();
  if (best.effects.empty() || IsFreeForm(best)) return same;
  const LinearFit& linear = about_null.linear();
  const Eigen::VectorXd change = about_null.ChangeOf(best.effects.front());
  const double length = linear.Inner(change, change);
  for (const ScreenedEffect& other : context.screened) {
    const Effect* effect = other.strongest.effect;
    if (effect == best.effects.front().effect || other.change.size() == 0) continue;
    if (IsFreeForm(*effect)) continue;
    const double product = linear.Inner(change, other.change);
    const double other_length = linear.Inner(other.change, other.change);
    if (other_length > thresholds::kAbsorbedInClass &&
        product * product > thresholds::kSameChange * length * other_length) {
      same.push_back(effect);
    }
  }
  return same;
}

}  // namespace sightline
