// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

double PromisedGain(const ScreenedEffect& screened) {
  return std::max(screened.gain, screened.linear_gain);
}

// Effects worth a fit, largest gain first.
std::vector<const ScreenedEffect*> MostPromising(const std::vector<ScreenedEffect>& all) {
  std::vector<const ScreenedEffect*> order;
  for (const ScreenedEffect& screened : all) {
    if (PromisedGain(screened) > thresholds::kWorthAFit_nats) order.push_back(&screened);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) {
    return PromisedGain(*a) > PromisedGain(*b);
  });
  if (order.size() > thresholds::kFitted) order.resize(thresholds::kFitted);
  return order;
}

// The set-up's parameters of the null model have taken the effect's place.
bool IsDisplaced(const ScreenedEffect& screened) {
  return screened.linear_gain > thresholds::kDisplacedGain_nats &&
         screened.gain < thresholds::kDisplacedPart * screened.linear_gain;
}

// From the nominal description, and if that went astray while the data had little weight, from the
// null model.
Hypothesis FitFromNominalOrNull(const Context& context, const ScreenedEffect& screened) {
  const ActiveEffect& start = IsDisplaced(screened) ? screened.linear_best : screened.strongest;
  Hypothesis far = FitFromNominal(context, MakeHypothesis({start}));
  if (far.log_evidence < thresholds::kAstray * PromisedGain(screened)) {
    Hypothesis near = FitHypothesis(context, MakeHypothesis({start}), context.null, {});
    if (near.log_evidence > far.log_evidence) return near;
  }
  return far;
}

}  // namespace

StageResult FitSingles(const Context& context, std::vector<Hypothesis> hypotheses) {
  const std::vector<const ScreenedEffect*> order = MostPromising(context.screened);
  const bool rejected = NullIsRejected(context);
  size_t from_nominal = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (!context.proceed(0.5 + 0.25 * static_cast<double>(i) / thresholds::kFitted)) {
      return {std::move(hypotheses), true};
    }
    const bool promising = i < thresholds::kFittedFromNominalAnyway &&
                           PromisedGain(*order[i]) > thresholds::kPromising_nats;
    if ((rejected || IsDisplaced(*order[i]) || promising) &&
        from_nominal < thresholds::kFittedFromNominal) {
      ++from_nominal;
      hypotheses.push_back(FitFromNominalOrNull(context, *order[i]));
    } else {
      hypotheses.push_back(
          FitHypothesis(context, MakeHypothesis({order[i]->strongest}), context.null, {}));
    }
  }
  return {SortedByEvidence(std::move(hypotheses))};
}

}  // namespace sightline
