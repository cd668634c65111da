// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

FitResult UnderOwnCovariance(const SetModel& model, const Hypothesis& hypothesis) {
  FitSettings settings;
  settings.rounds = {{0, 0.1}, {0, 0.02}, {0, 0}, {0, 0}};
  settings.max_iterations = 3;
  SetParameters start = hypothesis.fit.parameters;
  start.effects = hypothesis.effects;
  return FitSet(model, start, hypothesis.free, settings, nullptr);
}

// Each effect of the first hypothesis by itself replaces the one known if its evidence is larger.
std::vector<Hypothesis> FitPartsOfBest(const Context& context, std::vector<Hypothesis> hypotheses) {
  if (hypotheses.empty()) return hypotheses;
  const Hypothesis best = hypotheses.front();
  if (best.effects.size() < 2) return hypotheses;
  for (const ActiveEffect& part : best.effects) {
    Hypothesis alone = MakeHypothesis({part});
    alone.fit.parameters = best.fit.parameters;
    alone.fit.mean = best.fit.mean;
    alone = FitHypothesis(context, std::move(alone), context.linearisation, {true, 8});
    const auto known = std::find_if(hypotheses.begin(), hypotheses.end(), [&](const auto& h) {
      return h.effects.size() == 1 && h.effects[0].effect == part.effect;
    });
    if (known == hypotheses.end()) {
      hypotheses.push_back(std::move(alone));
    } else if (alone.log_evidence > known->log_evidence) {
      *known = std::move(alone);
    }
  }
  return SortedByEvidence(std::move(hypotheses));
}

}  // namespace

BestRefit RefitBest(const Context& context, const std::vector<Hypothesis>& hypotheses) {
  if (hypotheses.empty() || !NullIsRejected(context)) return {};
  if (!context.proceed(0.84)) return {{}, true};
  return {UnderOwnCovariance(context.model, hypotheses.front())};
}

ReferenceResult ReferenceOfBest(const Context& context, const std::vector<Hypothesis>& hypotheses,
                                std::optional<FitResult> best) {
  if (hypotheses.empty()) return {context.null, context.linearisation};
  if (!context.proceed(0.85)) return {context.null, context.linearisation, true};
  FitResult reference =
      best ? *std::move(best) : UnderOwnCovariance(context.model, hypotheses.front());
  FitSettings settings;
  settings.rounds.clear();
  settings.max_iterations = 8;
  SetParameters null_start = context.null.parameters;
  null_start.effects.clear();
  FitResult null = FitSet(context.model, null_start, {}, settings, &reference);
  return {std::move(null), std::move(reference)};
}

StageResult FitUnderOneCovariance(const Context& context, std::vector<Hypothesis> hypotheses) {
  const FitResult& reference = context.linearisation;
  if (hypotheses.size() > thresholds::kFitted) hypotheses.resize(thresholds::kFitted);
  for (size_t i = 0; i < hypotheses.size(); ++i) {
    if (!context.proceed(0.87 +
                         0.12 * static_cast<double>(i) / static_cast<double>(hypotheses.size()))) {
      return {std::move(hypotheses), true};
    }
    if (i == 0) {
      hypotheses[i].fit.parameters = reference.parameters;
      hypotheses[i].effects = reference.parameters.effects;
    }
    const bool renew = i < thresholds::kFittedAgain;
    hypotheses[i] =
        FitHypothesis(context, std::move(hypotheses[i]), reference, {renew, renew ? 6 : 3});
  }
  return {FitPartsOfBest(context, SortedByEvidence(std::move(hypotheses)))};
}

}  // namespace sightline
