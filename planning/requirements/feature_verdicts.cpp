// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/feature_verdicts.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/conformance/conformance.h"
#include "core/status/status_macros.h"
#include "planning/requirements/characteristic_of.h"
#include "planning/requirements/known_targets.h"

namespace sightline {
namespace {

void SetNotEvaluated(const absl::string_view reason, v1::FeatureVerdict* verdict) {
  verdict->set_verdict(v1::FeatureVerdict::NOT_EVALUATED);
  verdict->set_can_be_proven(false);
  verdict->set_because(absl::StrCat("not evaluated: ", reason));
}

void SetJudged(const FeatureConformance& judged, v1::FeatureVerdict* verdict) {
  verdict->set_verdict(judged.can_be_proven ? v1::FeatureVerdict::CAN_BE_PROVEN
                                            : v1::FeatureVerdict::CANNOT_BE_PROVEN);
  verdict->set_can_be_proven(judged.can_be_proven);
  verdict->set_because(judged.because);
  verdict->set_used_targets(judged.counts.used);
  if (!judged.predicted) return;
  verdict->set_uncertainty_m(judged.u.total_m);
  verdict->set_noise_m(judged.u.noise_m);
  verdict->set_sampling_m(judged.u.sampling_m);
  verdict->set_calibration_m(judged.u.calibration_m);
  verdict->set_registration_m(judged.u.registration_m);
  verdict->set_admissible_uncertainty_m(judged.admissible_u_m);
  verdict->set_acceptance_probability(judged.acceptance_probability);
  verdict->set_acceptance_zone_m(std::max(0.0, judged.acceptance_zone_m));
  verdict->set_probability_wrong_acceptance(judged.probability_wrong_acceptance);
  verdict->set_probability_wrong_rejection(judged.probability_wrong_rejection);
  if (judged.bias_m > 0) verdict->set_bias_m(judged.bias_m);
}

// Evaluates a feature by its characteristic.
absl::Status JudgeBound(const Inspection& inspection, const Requirements& requirements,
                        const PlanKnowledge& knowledge, const TolerancedFeature& toleranced,
                        const BoundCharacteristic& bound, v1::FeatureVerdict* verdict) {
  ConformanceOptions options;
  options.rule = requirements.rule;
  const double known_m = KnownUncertainty(inspection, requirements, toleranced);
  options.known_uncertainty_m = known_m;
  // Counts include all targets, also if joint errors are computed for a subset only.
  const std::vector<uint32_t> all = requirements.TargetsOf(toleranced, *knowledge.targets);
  TargetCounts& counts = options.counts.emplace();
  for (const uint32_t t : all) {
    const bool measured = knowledge.points[t] > 0;
    ++counts.all;
    counts.measured += measured;
    counts.used += measured && knowledge.uncertainty[t].total_m <= known_m;
  }
  Feature feature = MakeFeature(inspection, knowledge, bound.targets, known_m);
  LeaveOutCorrelation(bound, feature);
  const auto fit = FitCharacteristic(feature, bound.characteristic);
  if (absl::IsUnimplemented(fit.status())) return fit.status();
  if (fit.ok()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckModelSizes(ToleranceOf(requirements, toleranced), *fit, toleranced.zone_width_m));
  }
  double width_m = toleranced.zone_width_m;
  if (toleranced.zone_width_rad > 0) {
    // Without a fit the verdict states counts of targets only, whatever the width.
    const double reference_m = fit.ok() ? fit->reference_length_m : 1;
    width_m = toleranced.zone_width_rad * reference_m;
    if (fit.ok()) {
      verdict->set_reference_length_m(reference_m);
      verdict->set_zone_width_m(width_m);
    }
  }
  const double bonus_m = MaterialBonus(toleranced, bound, feature);
  if (bonus_m > 0) verdict->set_material_bonus_m(bonus_m);
  SIGHTLINE_ASSIGN_OR_RETURN(auto judged, JudgeCharacteristic(feature, fit, bound.characteristic,
                                                              width_m + bonus_m, options));
  SetJudged(judged, verdict);
  if (fit.ok() && judged.predicted) {
    verdict->mutable_because()->append(
        MiddleOfLimitsText(ToleranceOf(requirements, toleranced), *fit));
  }
  verdict->mutable_because()->append(AssociationText(requirements, toleranced));
  if (!judged.predicted) return absl::OkStatus();
  verdict->set_admissible_targets(0);
  for (const uint32_t t : all) {
    verdict->set_admissible_targets(
        verdict->admissible_targets() +
        (knowledge.points[t] > 0 && knowledge.uncertainty[t].total_m <= judged.admissible_u_m));
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<v1::FeatureVerdict> JudgeFeatures(const Inspection& inspection,
                                              const Requirements& requirements,
                                              const PlanKnowledge& knowledge) {
  std::vector<v1::FeatureVerdict> verdicts;
  for (const TolerancedFeature& toleranced : requirements.features) {
    v1::FeatureVerdict& verdict = verdicts.emplace_back();
    verdict.set_id(toleranced.id);
    verdict.set_name(toleranced.name);
    verdict.set_kind(ToleranceKindName(toleranced.kind));
    verdict.set_text(toleranced.text);
    if (toleranced.zone_width_m > 0) verdict.set_zone_width_m(toleranced.zone_width_m);
    const std::vector<uint32_t> all = requirements.TargetsOf(toleranced, *knowledge.targets);
    verdict.set_targets(static_cast<int64_t>(all.size()));
    for (const uint32_t t : all) {
      verdict.set_measured_targets(verdict.measured_targets() + (knowledge.points[t] > 0));
    }
    const auto bound =
        BindCharacteristic(toleranced, requirements, *knowledge.targets,
                           MostEvaluatedTargets(inspection, toleranced, knowledge.density.size()));
    absl::Status judged = bound.status();
    if (judged.ok()) {
      judged = JudgeBound(inspection, requirements, knowledge, toleranced, *bound, &verdict);
    }
    if (!judged.ok()) SetNotEvaluated(judged.message(), &verdict);
  }
  for (const UnboundTolerance& unbound : requirements.unbound) {
    v1::FeatureVerdict& verdict = verdicts.emplace_back();
    verdict.set_id(unbound.tolerance.id);
    verdict.set_name(unbound.tolerance.name);
    verdict.set_kind(ToleranceKindName(unbound.tolerance.kind));
    verdict.set_text(unbound.tolerance.text);
    if (unbound.tolerance.zone_width_m > 0)
      verdict.set_zone_width_m(unbound.tolerance.zone_width_m);
    SetNotEvaluated(unbound.reason, &verdict);
  }
  return verdicts;
}

v1::ToleranceCounts CountVerdicts(std::span<const v1::FeatureVerdict> verdicts) {
  int read = 0, evaluated = 0, proven = 0;
  for (const v1::FeatureVerdict& verdict : verdicts) {
    ++read;
    evaluated += verdict.verdict() != v1::FeatureVerdict::NOT_EVALUATED;
    proven += verdict.verdict() == v1::FeatureVerdict::CAN_BE_PROVEN;
  }
  v1::ToleranceCounts counts;
  counts.set_read(read);
  counts.set_evaluated(evaluated);
  counts.set_proven(proven);
  return counts;
}

}  // namespace sightline
