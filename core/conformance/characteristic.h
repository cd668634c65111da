// SPDX-License-Identifier: Apache-2.0
// Characteristics of a drawing as linear functions of the measured deviations: the surfaces that a
// tolerance binds, the datums that it refers to, and the weights with which deviations of targets
// add up to its measurand.
//
// Association is by least squares (Gauss) unless stated otherwise: every surface is fitted with its
// sizes free, and the datum system takes the six degrees of freedom of the part in the order of its
// datums (ISO 5459:2011). Degrees of freedom that the datums leave are those of best fit of the
// toleranced surfaces themselves (ISO 1101:2017, 4.5; composite tolerances and patterns: ISO
// 5458:2018). All surfaces of one tolerance are evaluated together; the worst counts.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/association/association.h"
#include "core/association/nominal_surface.h"
#include "core/conformance/decision.h"
#include "core/conformance/feature.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

// One surface, made of one or several faces; or the two parallel planes of a wall or slot.
struct FeatureElement {
  NominalSurface surface;    // for a width: either plane
  bool width = false;        // two planes with opposite normals; stands for its median plane
  std::vector<int> targets;  // indices into Feature::targets
};

enum class MaterialRequirement { kNone, kMaximum, kLeast };

struct Characteristic {
  ToleranceKind kind = ToleranceKind::kSurfaceProfile;
  std::vector<FeatureElement> elements;
  // The datums in the order of their precedence; a common datum ("A-B") or a pattern has several
  // elements.
  std::vector<std::vector<FeatureElement>> datums;
  // Whether the zone of a position grows with the actual size of the surface (ISO 2692:2021).
  MaterialRequirement material = MaterialRequirement::kNone;
  bool radius = false;  // the size is the radius, not the diameter
  // The coordinates of the model are the datum and count as exact, as for a zone that is not on the
  // drawing; `datums` is empty.
  bool exact_datum = false;
  // kChebyshev: form by the minimum zone (ISO 1101:2017); profiles without datums by the motion
  // that minimises the largest |deviation|. Other characteristics: Unimplemented.
  Association association = Association::kGauss;
};

// True if a characteristic of this kind can be associated by the minimum zone.
bool HasMinimumZone(ToleranceKind kind, bool has_datums);

struct CharacteristicFit {
  FeatureFit fit;
  Measurand measurand = Measurand::kDeviation;  // how it is evaluated
  ZoneKind zone = ZoneKind::kTwoSided;
  // Functionals of angles are arcs at this distance [m] from the vertex; 0 for other kinds.
  double reference_length_m = 0;
  // Sizes and distances of the model [m], one per functional; the functional is the change.
  std::vector<double> model_sizes_m;
};

// Least number of targets of a surface or datum for an evaluation.
inline constexpr size_t kFewestFeatureTargets = 6;

// FailedPrecondition: the measured targets do not determine the measurand. Unimplemented: the
// characteristic is not evaluated for these surfaces or datums; the message states the reason and
// continues a sentence that begins with the characteristic's name. Does not read Feature::geometry.
absl::StatusOr<CharacteristicFit> FitCharacteristic(const Feature& feature,
                                                    const Characteristic& characteristic);

}  // namespace sightline
