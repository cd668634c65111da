// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/diagnosis/transfer/setting_split.h"
#include "render_worker/diagnosis/transfer/transfer_score.h"

namespace sightline {
namespace {

constexpr Stage kStages[] = {Stage::kIllumination, Stage::kSurface, Stage::kOptics,
                             Stage::kGeometry,     Stage::kSensor,  Stage::kTime};

// Change of the null model's expectation by `active`, divided by `unit`.
BlockVectors ChangeBy(const Context& context, ActiveEffect active, double unit) {
  SetParameters parameters = context.null.parameters;
  parameters.effects = {std::move(active)};
  BlockVectors change = context.model.Expect(parameters, false).mean;
  for (size_t e = 0; e < change.size(); ++e) change[e] = (change[e] - context.null.mean[e]) / unit;
  return change;
}

bool IsFinite(const BlockVectors& change) {
  return std::all_of(change.begin(), change.end(),
                     [](const Eigen::VectorXd& block) { return block.allFinite(); });
}

// Functions of the stage's coordinates: every coefficient of its terms, and the effects of the
// vocabulary that screening found worth a fit, at their best shapes.
DiscrepancyColumns ColumnsOf(const Context& context, Stage stage) {
  DiscrepancyColumns columns;
  const auto add = [&](ActiveEffect active, double unit) {
    BlockVectors change = ChangeBy(context, std::move(active), unit);
    if (IsFinite(change)) columns.push_back(std::move(change));
  };
  for (const Effect* term : context.settings.free_forms) {
    if (term->description().stage != stage || HasRandomLaw(*term)) continue;
    const std::vector<EffectParameter>& parameters = term->description().parameters;
    for (size_t i = 0; i < parameters.size(); ++i) {
      ActiveEffect active = AtNullValues(*term);
      active.parameters[i] = ParameterFromStandardised(parameters[i], thresholds::kTermProbe);
      add(std::move(active), thresholds::kTermProbe);
    }
  }
  for (const ScreenedEffect& screened : context.screened) {
    const Effect& effect = *screened.strongest.effect;
    if (effect.description().stage != stage || IsFreeForm(effect)) continue;
    if (screened.gain > thresholds::kWorthAFit_nats) add(screened.strongest, 1);
  }
  return columns;
}

}  // namespace

std::vector<StageTransfer> TransferOfStages(const Context& context) {
  std::vector<DiscrepancyColumns> candidates = {{}};
  for (const Stage stage : kStages) candidates.push_back(ColumnsOf(context, stage));
  const std::vector<TransferScore> scores =
      ScoreTransfer(context.model, context.null, SplitBySettings(context.model), candidates);
  const auto best = std::max_element(
      scores.begin() + 1, scores.end(),
      [](const TransferScore& a, const TransferScore& b) { return a.Total() < b.Total(); });
  std::vector<StageTransfer> stages;
  for (size_t s = 0; s < std::size(kStages); ++s) {
    const TransferScore& score = scores[s + 1];
    const ScoreDifference behind = Difference(*best, score);
    stages.push_back({.stage = kStages[s],
                      .gain = score.Total() - scores.front().Total(),
                      .behind = behind.nats,
                      .behind_standard_error = behind.standard_error});
  }
  std::stable_sort(stages.begin(), stages.end(),
                   [](const StageTransfer& a, const StageTransfer& b) { return a.gain > b.gain; });
  return stages;
}

std::vector<Stage> StagesByTransfer(const std::vector<StageTransfer>& transfer) {
  std::vector<Stage> said;
  for (const StageTransfer& stage : transfer) {
    if (said.size() == thresholds::kStagesSaid || stage.gain <= 0) break;
    if (stage.behind > thresholds::kAlikeStages_standard_errors * stage.behind_standard_error) {
      break;
    }
    said.push_back(stage.stage);
  }
  return said;
}

}  // namespace sightline
