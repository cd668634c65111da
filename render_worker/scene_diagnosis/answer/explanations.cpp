// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/answer/explanations.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "render_worker/evidence/answer_text.h"
#include "render_worker/evidence/evidence.h"
#include "render_worker/evidence/judgement.h"
#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

// Quantile of the standard normal distribution for an interval of 95 %.
constexpr double kInterval95 = 1.96;
// Chi squared of an effect that is clearly detected: twice 5 nats of log-likelihood.
constexpr double kDetectedChiSquared = 10;

std::string PlaceText(const Eigen::Vector3d& place_m) {
  return absl::StrFormat("(%.0f, %.0f, %.0f) mm of the part", 1e3 * place_m.x(), 1e3 * place_m.y(),
                         1e3 * place_m.z());
}

void AddParameters(const LightPath& path, double factor, double error, v1::FittedEffect* effect) {
  v1::FittedParameter* fitted = effect->add_parameters();
  fitted->set_name(path.parameter);
  fitted->set_value(factor);
  fitted->set_standard_error(error);
  const double lower = factor - kInterval95 * error;
  fitted->set_lower(path.may_be_negative ? lower : std::max(0.0, lower));
  fitted->set_upper(factor + kInterval95 * error);
  if (path.shape_name.empty()) return;
  v1::FittedParameter* shape = effect->add_parameters();
  shape->set_name(path.shape_name);
  shape->set_value(path.shape);
  shape->set_lower(path.shape_lower);
  shape->set_upper(path.shape_upper);
}

void AddRegions(const RecordedScene& scene, const ExcessRegion& region, v1::FittedEffect* effect) {
  if (region.recording < 0) return;
  effect->add_regions(absl::StrFormat(
      "%s: rows %d-%d, columns %d-%d",
      scene.recordings.recordings[static_cast<size_t>(region.recording)].file, region.first_row_px,
      region.last_row_px, region.first_column_px, region.last_column_px));
  if (region.surface.empty()) return;
  effect->add_regions(
      absl::StrFormat("surface \"%s\" (%.0f %%)", region.surface, 100 * region.surface_share));
  effect->add_regions("brightest at " + PlaceText(region.place_m));
}

void AddEffects(const PathFit& fit, const ExcessRegion& region, const RecordedScene& scene,
                v1::Explanation* explanation) {
  for (size_t k = 0; k < fit.paths.size(); ++k) {
    const LightPath& path = *fit.paths[k];
    if (path.nominal || path.effect == kUnknownLight) continue;
    const auto i = static_cast<Eigen::Index>(k);
    v1::FittedEffect* effect = explanation->add_effects();
    effect->set_effect(path.effect);
    effect->set_stage(path.stage);
    AddParameters(path, fit.factors[i], std::sqrt(fit.covariance(i, i)), effect);
    AddRegions(scene, region, effect);
  }
}

bool IsUnknown(const PathHypothesis& hypothesis) {
  return !hypothesis.effects.empty() && hypothesis.effects.front() == kUnknownLight;
}

std::string ReasonFor(const PathComparison& comparison, const PathHypothesis& hypothesis,
                      const PathHypothesis& best) {
  const char* most = comparison.finished ? "the most probable" : "the best so far";
  if (&hypothesis == &best) {
    const bool off = best.Name() == kInterreflection;
    return absl::StrCat(most, off ? "; render.laser_interreflection switches it on" : "");
  }
  if (!hypothesis.predicts) {
    return absl::StrFormat(
        "predicts held-out tiles less than %.0f nats better than without it, or with one effect "
        "less",
        kClearGain_nats);
  }
  if (IsUnknown(hypothesis) && !IsUnknown(best) && comparison.remainder) {
    return WhyTermDoesNotLead(
        {.more_evidence = hypothesis.log_predictive - best.log_predictive,
         .more_held_out_score = hypothesis.best.HeldOutLogDensity() - best.best.HeldOutLogDensity(),
         .share_left = comparison.remainder->share});
  }
  const double below = best.log_predictive - hypothesis.log_predictive;
  return absl::StrFormat("log evidence %.1f %s %s%s", std::abs(below),
                         below < 0 ? "above" : "below", most,
                         below < 0 ? ", but less probable beforehand" : "");
}

void AddRemainder(const PathComparison& comparison, v1::Diagnosis* diagnosis) {
  if (!comparison.remainder) return;
  v1::Remainder* remainder = diagnosis->mutable_remainder();
  const int discrepancy = comparison.remainder->discrepancy;
  if (discrepancy >= 0) {
    remainder->set_stage(comparison.hypotheses[static_cast<size_t>(discrepancy)].stage);
  }
  remainder->set_share(comparison.remainder->share);
  remainder->set_probability(comparison.remainder->probability);
}

}  // namespace

std::vector<const PathHypothesis*> RankHypotheses(const std::vector<PathHypothesis>& hypotheses) {
  std::vector<const PathHypothesis*> ranked;
  for (const PathHypothesis& h : hypotheses) ranked.push_back(&h);
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const PathHypothesis* a, const PathHypothesis* b) {
                     if (a->probability != b->probability) return a->probability > b->probability;
                     return a->log_prior + a->log_predictive > b->log_prior + b->log_predictive;
                   });
  return ranked;
}

void AddExplanations(const RecordedScene& scene, const PathComparison& comparison,
                     const std::vector<const PathHypothesis*>& ranked, const ExcessRegion& region,
                     v1::Diagnosis* diagnosis) {
  const PathHypothesis& best = *ranked.front();
  const Evidence none = comparison.hypotheses[0].Terms();
  std::map<std::string, double> stages;
  for (const PathHypothesis* hypothesis : ranked) {
    if (!hypothesis->stage.empty()) stages[hypothesis->stage] += hypothesis->probability;
    v1::Explanation* explanation = diagnosis->add_ranked();
    explanation->set_effect(hypothesis->effects.empty() ? "none" : hypothesis->effects.front());
    explanation->set_stage(hypothesis->stage);
    explanation->set_probability(hypothesis->probability);
    explanation->set_log_evidence_gain(hypothesis->log_predictive -
                                       comparison.hypotheses[0].log_predictive);
    explanation->set_held_out_chi_squared_per_dof(hypothesis->best.HeldOutChiSquaredPerDegree());
    AddEffects(hypothesis->best, hypothesis == &best ? region : ExcessRegion(), scene, explanation);
    *explanation->mutable_evidence() = EvidenceToProto(hypothesis->Terms() - none);
    explanation->set_reason(ReasonFor(comparison, *hypothesis, best));
  }
  AddRemainder(comparison, diagnosis);
  for (const auto& [stage, probability] : stages) {
    v1::StageEvidence* evidence = diagnosis->add_stages();
    evidence->set_stage(stage);
    evidence->set_probability(probability);
  }
}

void AddDetectableStrengths(const std::vector<PathHypothesis>& hypotheses,
                            v1::Diagnosis* diagnosis) {
  for (const PathHypothesis& hypothesis : hypotheses) {
    if (hypothesis.effects.size() != 1 || hypothesis.effects[0] == kUnknownLight) continue;
    const LightPath& path = *hypothesis.best.paths.back();
    const Eigen::Index k = hypothesis.best.factors.size() - 1;
    const double information =
        1 / hypothesis.best.covariance(k, k) - 1 / std::pow(path.prior_standard_deviation, 2);
    if (information <= 0) continue;
    v1::DetectableStrength* strength = diagnosis->add_power();
    strength->set_effect(path.effect);
    strength->set_parameter(path.parameter);
    strength->set_strength(std::sqrt(kDetectedChiSquared / information));
    if (!path.shape_name.empty()) {
      strength->set_unit_note(absl::StrCat(path.shape_name, " = ", path.shape));
    }
  }
}

}  // namespace sightline
