// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/terms/term_columns.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/diagnosis/transfer/setting_split.h"
#include "render_worker/diagnosis/transfer/transfer_score.h"

namespace sightline {
namespace {

TransferScore ScoreOf(const Context& context, const FitResult& fit,
                      const std::vector<SettingSplit>& splits) {
  return ScoreTransfer(context.model, fit, splits, {{}}).front();
}

std::set<Stage> StagesOf(const Hypothesis& hypothesis) {
  std::set<Stage> stages;
  for (const ActiveEffect& active : hypothesis.effects) {
    stages.insert(active.effect->description().stage);
  }
  return stages;
}

// Realised values of a random effect are uninformative about held-out settings.
bool CanPredictSettings(const Hypothesis& hypothesis) {
  return !hypothesis.effects.empty() && hypothesis.realised.empty() &&
         hypothesis.phases_rad.empty() &&
         std::none_of(hypothesis.effects.begin(), hypothesis.effects.end(),
                      [](const ActiveEffect& active) { return HasRandomLaw(*active.effect); });
}

// The hypotheses of largest evidence that act at `stage`, by themselves or with others.
std::vector<const Hypothesis*> LeadingAt(Stage stage, const std::vector<Hypothesis>& hypotheses) {
  std::vector<const Hypothesis*> leading;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (CanPredictSettings(hypothesis) && StagesOf(hypothesis).contains(stage)) {
      leading.push_back(&hypothesis);
    }
  }
  std::stable_sort(leading.begin(), leading.end(), [](const Hypothesis* a, const Hypothesis* b) {
    return a->log_evidence > b->log_evidence;
  });
  if (leading.size() > thresholds::kTransferredOfStage) {
    leading.resize(thresholds::kTransferredOfStage);
  }
  return leading;
}

}  // namespace

std::vector<StageTransfer> TransferOfStages(const Context& context,
                                            const std::vector<Hypothesis>& hypotheses) {
  const std::vector<SettingSplit> splits = SplitBySettings(context.model);
  const TransferScore none = ScoreOf(context, context.null, splits);
  std::vector<std::pair<Stage, TransferScore>> scores;
  for (const Stage stage : kStages) {
    TransferScore best = none;
    for (const Hypothesis* hypothesis : LeadingAt(stage, hypotheses)) {
      TransferScore score = ScoreOf(context, hypothesis->fit, splits);
      if (score.Total() > best.Total()) best = std::move(score);
    }
    scores.emplace_back(stage, std::move(best));
  }
  std::stable_sort(scores.begin(), scores.end(), [](const auto& a, const auto& b) {
    return a.second.Total() > b.second.Total();
  });
  std::vector<StageTransfer> stages;
  for (const auto& [stage, score] : scores) {
    const ScoreDifference behind = Difference(scores.front().second, score);
    stages.push_back({.stage = stage,
                      .gain = score.Total() - none.Total(),
                      .behind = behind.nats,
                      .behind_standard_error = behind.standard_error});
  }
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
