// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/judge_paths.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

bool IsPartOf(const PathHypothesis& part, const PathHypothesis& whole) {
  return !part.effects.empty() && part.effects.size() < whole.effects.size() &&
         std::all_of(part.effects.begin(), part.effects.end(), [&](const std::string& effect) {
           return std::find(whole.effects.begin(), whole.effects.end(), effect) !=
                  whole.effects.end();
         });
}

ModelKind KindOf(const PathHypothesis& hypothesis) {
  if (hypothesis.effects.empty()) return ModelKind::kNoEffect;
  return hypothesis.effects.front() == kUnknownLight ? ModelKind::kDiscrepancy : ModelKind::kNamed;
}

ComparedModel Compared(const std::vector<PathHypothesis>& hypotheses, size_t index) {
  const PathHypothesis& hypothesis = hypotheses[index];
  ComparedModel model{.kind = KindOf(hypothesis),
                      .log_evidence = hypothesis.log_predictive - hypotheses[0].log_predictive,
                      .log_prior = hypothesis.log_prior,
                      .held_out_score = hypothesis.best.HeldOutLogDensity(),
                      .held_out_excess = hypothesis.best.HeldOutChiSquaredPerDegree() - 1};
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    if (IsPartOf(hypotheses[h], hypothesis)) model.parts.push_back(static_cast<int>(h));
  }
  return model;
}

}  // namespace

JudgedPaths JudgePaths(const std::vector<PathHypothesis>& hypotheses) {
  std::vector<ComparedModel> models;
  for (size_t h = 0; h < hypotheses.size(); ++h) models.push_back(Compared(hypotheses, h));
  JudgedPaths judged;
  judged.predicts = Predicting(models);

  std::vector<ComparedModel> predicting;
  std::vector<size_t> index;  // of `predicting` among all
  for (size_t h = 0; h < models.size(); ++h) {
    if (!judged.predicts[h]) continue;
    predicting.push_back(models[h]);
    index.push_back(h);
  }
  constexpr double kNoCheck = 1;
  const Judgement judgement = Judge(predicting, kNoCheck);

  judged.probability.assign(hypotheses.size(), 0);
  for (size_t m = 0; m < index.size(); ++m) {
    judged.probability[index[m]] = judgement.probability[m];
  }
  judged.remainder = judgement.remainder;
  if (judged.remainder && judged.remainder->discrepancy >= 0) {
    int& discrepancy = judged.remainder->discrepancy;
    discrepancy = static_cast<int>(index[static_cast<size_t>(discrepancy)]);
  }
  return judged;
}

}  // namespace sightline
