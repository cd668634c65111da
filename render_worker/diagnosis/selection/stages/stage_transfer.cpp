// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/stages/term_columns.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/diagnosis/transfer/setting_split.h"
#include "render_worker/diagnosis/transfer/transfer_score.h"

namespace sightline {
namespace {

// Change from the null model's expectation to `mean`, divided by `unit`.
BlockVectors Change(const Context& context, BlockVectors mean, double unit) {
  for (size_t e = 0; e < mean.size(); ++e) mean[e] = (mean[e] - context.null.mean[e]) / unit;
  return mean;
}

bool IsFinite(const BlockVectors& change) {
  return std::all_of(change.begin(), change.end(),
                     [](const Eigen::VectorXd& block) { return block.allFinite(); });
}

// Functions of the stage's coordinates: every coefficient of its terms, and the effects of the
// vocabulary that screening found worth a fit, at their best shapes.
DiscrepancyColumns ColumnsOf(const Context& context, Stage stage) {
  DiscrepancyColumns columns;
  for (TermColumn& column : TermColumnsOf(context, context.null.parameters, stage)) {
    columns.push_back(Change(context, std::move(column.mean), thresholds::kTermProbe));
  }
  for (const ScreenedEffect& screened : context.screened) {
    const Effect& effect = *screened.strongest.effect;
    if (effect.description().stage != stage || IsFreeForm(effect)) continue;
    if (screened.gain <= thresholds::kWorthAFit_nats) continue;
    SetParameters parameters = context.null.parameters;
    parameters.effects = {screened.strongest};
    BlockVectors change = Change(context, context.model.Expect(parameters, false).mean, 1);
    if (IsFinite(change)) columns.push_back(std::move(change));
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
