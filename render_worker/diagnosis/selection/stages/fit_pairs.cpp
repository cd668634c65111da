// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

bool SameEffects(const Hypothesis& a, const Hypothesis& b) {
  return a.effects.size() == b.effects.size() &&
         std::all_of(a.effects.begin(), a.effects.end(),
                     [&](const ActiveEffect& active) { return Has(b, active.effect); });
}

// Combinations of `count` effects that may be worth a fit.
struct JointsResult {
  std::vector<JointEffect> joints;  // sorted by total
  bool stopped = false;
};

// `hypotheses` from `first` on, of one effect less.
JointsResult JointsOf(const Context& context, const std::vector<Hypothesis>& hypotheses,
                      size_t first, int count) {
  std::vector<JointEffect> joints;
  size_t bases = 0;
  for (size_t h = first; h < hypotheses.size() && bases < thresholds::kBases; ++h) {
    const Hypothesis& base = hypotheses[h];
    if (IsFreeForm(base) || base.effects.size() + 1 != static_cast<size_t>(count)) continue;
    const bool best = count == 2 && bases == 0 && base.log_evidence > thresholds::kPromising_nats;
    ++bases;
    const ScreeningResult shapes = best ? ScreenShapes(context, base) : ScreeningResult{};
    if (shapes.stopped) return {{}, true};
    const std::vector<JointEffect> added = JointGains(context, base, shapes.effects);
    joints.insert(joints.end(), added.begin(), added.end());
  }
  return {SortedByTotal(std::move(joints))};
}

// Fits the first kPairs of `joints` that gain enough.
StageResult FitJoints(const Context& context, const std::vector<JointEffect>& joints) {
  std::vector<Hypothesis> fitted;
  for (const JointEffect& joint : joints) {
    if (fitted.size() == thresholds::kPairs) break;
    if (joint.gain < thresholds::kPairGain_nats) continue;
    if (!context.proceed(0.77 + 0.02 * static_cast<double>(fitted.size()))) return {{}, true};
    std::vector<ActiveEffect> effects = joint.base->effects;
    effects.push_back(joint.added);
    Hypothesis hypothesis = MakeHypothesis(std::move(effects));
    // The same effects may have been put together in another order.
    if (std::any_of(fitted.begin(), fitted.end(),
                    [&](const Hypothesis& other) { return SameEffects(other, hypothesis); })) {
      continue;
    }
    hypothesis.fit.parameters = joint.base->fit.parameters;
    hypothesis.fit.mean = joint.base->fit.mean;
    hypothesis = FitHypothesis(context, std::move(hypothesis), context.null, {});
    // A start without any light cannot carry further effects.
    if (std::isfinite(hypothesis.log_evidence)) fitted.push_back(std::move(hypothesis));
  }
  return {std::move(fitted)};
}

}  // namespace

StageResult FitPairs(const Context& context, std::vector<Hypothesis> hypotheses) {
  size_t first = 0;
  for (int count = 2; count <= context.settings.max_effects; ++count) {
    const JointsResult found = JointsOf(context, hypotheses, first, count);
    if (found.stopped) return {std::move(hypotheses), true};
    StageResult fitted = FitJoints(context, found.joints);
    if (fitted.stopped) return {std::move(hypotheses), true};
    first = hypotheses.size();
    if (fitted.hypotheses.empty()) break;
    std::move(fitted.hypotheses.begin(), fitted.hypotheses.end(), std::back_inserter(hypotheses));
  }
  return {SortedByEvidence(std::move(hypotheses))};
}

}  // namespace sightline
