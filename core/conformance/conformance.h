// SPDX-License-Identifier: Apache-2.0
// Predicts if a plan of scans can prove that a toleranced feature conforms, before the
// measurement.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/conformance/acceptance.h"
#include "core/conformance/characteristic.h"
#include "core/conformance/decision.h"
#include "core/conformance/feature.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

// The measurand of a tolerance of a single feature; nullopt for angles and run-out, which need
// datums (FitCharacteristic). Form and orientation have one-sided zones: their values lie between
// zero and the zone's width.
struct ToleranceMeasurand {
  Measurand measurand;
  ZoneKind zone;
};
std::optional<ToleranceMeasurand> MeasurandOf(ToleranceKind kind);

struct ConformanceOptions {
  DecisionRule rule;
  // Fraction of the targets that must be measured, for profiles with enough certainty. (0, 1].
  double required_share = 0.95;
  // Distribution of parts before measurement; by default a process of capability 1.
  std::optional<Production> production;
  uint64_t seed = 1;
  // Limit [m] on the uncertainty of targets with FeatureTarget::known; unset: all measured ones.
  std::optional<double> known_uncertainty_m;
  // Counts of all targets if the feature holds only a selection; unset: it holds all targets.
  std::optional<TargetCounts> counts;
};

struct FeatureConformance {
  TargetCounts counts;
  // False: the plan's targets do not determine the measurand, and the members below are not set.
  bool predicted = false;
  // Uncertainty of the measurand. Profiles: the quantile `required_share` over all targets, where
  // targets that are not measured come last.
  SurfaceUncertainty u{};
  double largest_u_m = 0;        // over measured targets or functionals
  double percentile_95_u_m = 0;  // profiles: over measured targets; else largest_u_m
  double bias_m = 0;             // form: mean measured value of a perfect feature
  // Width of the zone of accepted deviations: s_t - 2 g u; one-sided s_t - g u - bias.
  double acceptance_zone_m = 0;
  // Global risks for the stated production and this measurement (JCGM 106, 9.5); for profiles, of
  // one target. Form: wrong rejection includes the bias, wrong acceptance does not, because the
  // bias vanishes on parts of large form.
  double probability_wrong_acceptance = 0;
  double probability_wrong_rejection = 0;
  // Probability that the rule accepts a good part after this measurement (PredictAcceptance).
  double acceptance_probability = 0;
  // Largest u at which the acceptance zone has the width that the rule requires and a good part is
  // accepted with probability 1/2.
  double admissible_u_m = 0;
  double admissible_share = 0;  // profiles: fraction measured with admissible u; else used, or 0
  bool can_be_proven = false;
  // The reason, with the figures above; begins with "can be proven: " or "cannot be proven: ".
  std::string because;
};

// Conformity can be proven if a good part, which has no deviations, is accepted with at least this
// probability.
inline constexpr double kProvableAcceptance = 0.5;

// Judges the feature by the tolerance zone. The acceptance zone must be at least the rule's
// fraction of the zone and not empty, and a good part must be accepted (kProvableAcceptance).
// InvalidArgument: feature, zone or options are outside their ranges. If the measured targets do
// not determine the fit, that is a verdict, not an error.
absl::StatusOr<FeatureConformance> JudgeFeature(const Feature& feature, Measurand measurand,
                                                const ToleranceZone& zone,
                                                const ConformanceOptions& options = {});

// Judges a characteristic of a drawing by its fit, which states the measurand and the kind of zone.
// `width_m` is the width of the zone; for an angle, the arc at the reference length. Returns errors
// of FitCharacteristic other than FailedPrecondition.
absl::StatusOr<FeatureConformance> JudgeCharacteristic(const Feature& feature,
                                                       const absl::StatusOr<CharacteristicFit>& fit,
                                                       const Characteristic& characteristic,
                                                       double width_m,
                                                       const ConformanceOptions& options = {});

}  // namespace sightline
