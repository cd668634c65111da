// SPDX-License-Identifier: Apache-2.0
// Whether a plan of scans can prove that a toleranced feature conforms, before anything is
// measured.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/conformance/decision.h"
#include "core/conformance/feature.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

// What a tolerance is about; not set for angles, and for run-out, which combines form and position
// about an axis and is not predicted here. Form and orientation have one-sided zones: they are
// amounts, and may be anything from zero to the zone's width.
struct ToleranceMeasurand {
  Measurand measurand;
  ZoneKind zone;
};
std::optional<ToleranceMeasurand> MeasurandOf(ToleranceKind kind);

struct ConformanceOptions {
  DecisionRule rule;
  // Share of the targets that must be measured, and with profiles known well enough. (0, 1].
  double required_share = 0.95;
  // What the parts are before measurement; by default a process of capability 1.
  std::optional<Production> production;
  uint64_t seed = 1;
};

struct FeatureConformance {
  // Of the measurand. Profiles: of the target that `required_share` of all targets do not exceed,
  // the targets that are not measured coming last.
  SurfaceUncertainty u{};
  double largest_u_m = 0;        // over measured targets or functionals
  double percentile_95_u_m = 0;  // profiles: over measured targets; else largest_u_m
  double bias_m = 0;             // form: what is measured on a perfect feature
  // Deviations that a part may have and be accepted: s_t - 2 g u; one-sided s_t - g u - bias.
  double acceptance_zone_m = 0;
  // Of a part of the stated production and its measurement (JCGM 106, 9.5); with profiles of one
  // target. Form: the bias is left out of wrong acceptance and counted in wrong rejection, because
  // it vanishes on parts of large form.
  double probability_wrong_acceptance = 0;
  double probability_wrong_rejection = 0;
  double measured_share = 0;
  double admissible_share = 0;  // profiles: measured and u admissible; else measured_share or 0
  bool can_be_proven = false;
  std::string because;
};

// Judges the feature by the tolerance zone. The acceptance zone must be at least the rule's share
// of the zone and not empty. InvalidArgument where the feature, zone or options are outside their
// ranges; a feature that cannot be fitted to what is measured is a verdict, not an error.
absl::StatusOr<FeatureConformance> JudgeFeature(const Feature& feature, Measurand measurand,
                                                const ToleranceZone& zone,
                                                const ConformanceOptions& options = {});

}  // namespace sightline
