// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/judgement.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "render_worker/evidence/significance.h"

namespace sightline {
namespace {

double LogPosterior(const ComparedModel& model) { return model.log_evidence + model.log_prior; }

int IndexOfNone(const std::vector<ComparedModel>& models) {
  const auto none = std::find_if(models.begin(), models.end(), [](const ComparedModel& model) {
    return model.kind == ModelKind::kNoEffect;
  });
  assert(none != models.end());
  return static_cast<int>(none - models.begin());
}

// Index of the most probable model for which `include` holds; -1: there is none.
template <typename Include>
int MostProbable(const std::vector<ComparedModel>& models, Include&& include) {
  int best = -1;
  for (size_t m = 0; m < models.size(); ++m) {
    if (!include(models[m])) continue;
    if (best < 0 || LogPosterior(models[m]) > LogPosterior(models[best])) {
      best = static_cast<int>(m);
    }
  }
  return best;
}

// Probabilities by evidence and prior among the models that `include` accepts, times `share`.
template <typename Include>
void ShareOut(const std::vector<ComparedModel>& models, double share, Include&& include,
              std::vector<double>* probability) {
  const int best = MostProbable(models, include);
  if (best < 0) return;
  double sum = 0;
  for (size_t m = 0; m < models.size(); ++m) {
    if (!include(models[m])) continue;
    (*probability)[m] = std::exp(LogPosterior(models[m]) - LogPosterior(models[best]));
    sum += (*probability)[m];
  }
  for (size_t m = 0; m < models.size(); ++m) {
    if (include(models[m])) (*probability)[m] *= share / sum;
  }
}

bool IsDiscrepancy(const ComparedModel& model) { return model.kind == ModelKind::kDiscrepancy; }
bool IsWithinVocabulary(const ComparedModel& model) { return !IsDiscrepancy(model); }

}  // namespace

std::vector<bool> Predicting(const std::vector<ComparedModel>& models) {
  const ComparedModel& none = models[IndexOfNone(models)];
  std::vector<bool> predicting;
  for (const ComparedModel& model : models) {
    double without = none.held_out_score;
    for (const int part : model.parts) without = std::max(without, models[part].held_out_score);
    predicting.push_back(model.kind == ModelKind::kNoEffect ||
                         model.held_out_score - without > kClearGain_nats);
  }
  return predicting;
}

double ShareLeft(const ComparedModel& model, const ComparedModel& none,
                 const ComparedModel* discrepancy) {
  if (model.kind == ModelKind::kNoEffect) return 1;
  double share = none.held_out_excess > 0 ? model.held_out_excess / none.held_out_excess : 0;
  if (discrepancy != nullptr && discrepancy->held_out_score > none.held_out_score) {
    share = std::max(share, (discrepancy->held_out_score - model.held_out_score) /
                                (discrepancy->held_out_score - none.held_out_score));
  }
  return std::clamp(share, 0.0, 1.0);
}

int BestNamed(const std::vector<ComparedModel>& models) {
  return MostProbable(models, IsWithinVocabulary);
}

Judgement Judge(const std::vector<ComparedModel>& models, double best_named_p_value,
                double share_names_may_leave) {
  Judgement judgement;
  judgement.best_named = BestNamed(models);
  const ComparedModel& named = models[judgement.best_named];
  const int discrepancy = MostProbable(models, IsDiscrepancy);
  const double share_left = ShareLeft(named, models[IndexOfNone(models)],
                                      discrepancy >= 0 ? &models[discrepancy] : nullptr);

  judgement.probability.assign(models.size(), 0);
  ShareOut(
      models, 1, [](const ComparedModel&) { return true; }, &judgement.probability);
  double unknown = 0;
  for (size_t m = 0; m < models.size(); ++m) {
    if (IsDiscrepancy(models[m])) unknown += judgement.probability[m];
  }
  if (best_named_p_value < kRejectedBelow) {
    unknown = std::max(unknown, ProbabilityOfUnknown(best_named_p_value));
  }

  const bool discrepancy_is_better =
      discrepancy >= 0 && models[discrepancy].log_evidence > named.log_evidence &&
      models[discrepancy].held_out_score - named.held_out_score > kClearGain_nats;
  const bool discrepancy_leads = discrepancy_is_better && share_left > share_names_may_leave;
  if (discrepancy_leads) {
    ShareOut(models, 1 - unknown, IsWithinVocabulary, &judgement.probability);
    ShareOut(models, unknown, IsDiscrepancy, &judgement.probability);
  } else {
    std::fill(judgement.probability.begin(), judgement.probability.end(), 0);
    ShareOut(models, 1, IsWithinVocabulary, &judgement.probability);
    if (discrepancy >= 0 || best_named_p_value < kRejectedBelow) {
      judgement.remainder = {.discrepancy = discrepancy,
                             .share = share_left,
                             .probability = unknown,
                             .small_share_decides = discrepancy_is_better};
    }
  }
  judgement.answer = static_cast<int>(
      std::max_element(judgement.probability.begin(), judgement.probability.end()) -
      judgement.probability.begin());
  return judgement;
}

}  // namespace sightline
