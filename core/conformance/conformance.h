// SPDX-License-Identifier: Apache-2.0
// Whether a plan of scans can prove that a toleranced feature conforms, before anything is
// measured.
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

// The measurand of a tolerance of a single feature; not set for angles and run-out, which need
// datums (FitCharacteristic). Form and orientation have one-sided zones: they are amounts, and may
// be anything from zero to the zone's width.
struct ToleranceMeasurand {
  Measurand measurand;
  ZoneKind zone;
};
std::optional<ToleranceMeasurand> MeasurandOf(ToleranceKind kind);

struct ConformanceOptions {
  DecisionRule rule;
  // Share of the targets that must be measured, and with profiles known well enough. (0, 1].
  double required_share = 0.95;
  // Distribution of parts before measurement; by default a process of capability 1.
  std::optional<Production> production;
  uint64_t seed = 1;
  // Limit [m] by which FeatureTarget::known was decided; unset: all measured targets are known.
  std::optional<double> known_uncertainty_m;
  // Counts of all targets, where the feature holds a selection of them; unset: it holds all.
  std::optional<TargetCounts> counts;
};

struct FeatureConformance {
  TargetCounts counts;
  // False: the plan's targets do not determine the measurand; then what follows is not set.
  bool predicted = false;
  // Uncertainty of the measurand. Profiles: that of the target that `required_share` of all targets
  // do not exceed, the targets that are not measured coming last.
  SurfaceUncertainty u{};
  double largest_u_m = 0;        // over measured targets or functionals
  double percentile_95_u_m = 0;  // profiles: over measured targets; else largest_u_m
  double bias_m = 0;             // form: what is measured on a perfect feature
  // Deviations that a part may have and be accepted: s_t - 2 g u; one-sided s_t - g u - bias.
  double acceptance_zone_m = 0;
  // Global risks of the stated production and its measurement (JCGM 106, 9.5); for profiles, of one
  // target. Form: the bias is left out of wrong acceptance and counted in wrong rejection, because
  // it vanishes on parts of large form.
  double probability_wrong_acceptance = 0;
  double probability_wrong_rejection = 0;
  // Probability that the rule accepts a good part, measured so (PredictAcceptance).
  double acceptance_probability = 0;
  // Largest u at which the acceptance zone is as wide as the rule asks, and at which a good part is
  // accepted as often as not.
  double admissible_u_m = 0;
  double admissible_share = 0;  // profiles: measured and u admissible; else share used, or 0
  bool can_be_proven = false;
  // Why, with the figures above; begins with "can be proven: " or "cannot be proven: ".
  std::string because;
};

// Conformity can be proven if a good part, which has no deviations, is accepted with at least this
// probability.
inline constexpr double kProvableAcceptance = 0.5;

// Judges the feature by the tolerance zone. The acceptance zone must be at least the rule's share
// of the zone and not empty, and a good part must be accepted (kProvableAcceptance).
// InvalidArgument where the feature, zone or options are outside their
// ranges; a feature that cannot be fitted to what is measured is a verdict, not an error.
absl::StatusOr<FeatureConformance> JudgeFeature(const Feature& feature, Measurand measurand,
                                                const ToleranceZone& zone,
                                                const ConformanceOptions& options = {});

// Judges a characteristic of a drawing by its fit, which states the measurand and the kind of zone.
// `width_m` is the width of the zone; for an angle it is the arc at the reference length. Errors of
// FitCharacteristic other than FailedPrecondition are passed on.
absl::StatusOr<FeatureConformance> JudgeCharacteristic(const Feature& feature,
                                                       const absl::StatusOr<CharacteristicFit>& fit,
                                                       const Characteristic& characteristic,
                                                       double width_m,
                                                       const ConformanceOptions& options = {});

}  // namespace sightline
