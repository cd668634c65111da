// SPDX-License-Identifier: Apache-2.0
// Characteristics of a drawing as linear functions of what is measured: which surfaces a tolerance
// binds, which datums it refers to, and the weights with which deviations of targets add up to its
// measurand.
//
// Association is by least squares (Gauss) unless stated otherwise: every surface is fitted with its
// sizes free, and the datum system takes the six degrees of freedom of the part in the order of its
// datums (ISO 5459:2011). Degrees of freedom that the datums leave are those of best fit of the
// toleranced surfaces themselves (ISO 1101:2017, 4.5; composite tolerances and patterns: ISO
// 5458:2018). All surfaces of one tolerance are judged together; the worst counts.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/association/association.h"
#include "core/association/nominal_surface.h"
#include "core/conformance/decision.h"
#include "core/conformance/feature.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

// One surface: of one or several faces, or the two parallel planes of a wall or slot.
struct FeatureElement {
  NominalSurface surface;    // of a width: either plane
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
  // The coordinates of the model are the datum and taken as exact, as for a zone that is not on the
  // drawing; `datums` is empty.
  bool exact_datum = false;
  // kChebyshev: form by the minimum zone (ISO 1101:2017); profiles without datums by the motion
  // that makes the largest |deviation| least. Of other characteristics Unimplemented.
  Association association = Association::kGauss;
};

// Whether a characteristic of this kind can be associated by the minimum zone.
bool HasMinimumZone(ToleranceKind kind, bool has_datums);

struct CharacteristicFit {
  FeatureFit fit;
  Measurand measurand = Measurand::kDeviation;  // how it is evaluated
  ZoneKind zone = ZoneKind::kTwoSided;
  // Functionals of angles are arcs at this distance [m] from the vertex; 0 for other kinds.
  double reference_length_m = 0;
  // Sizes and distances: what the model has [m], one per functional, which is the change of it.
  std::vector<double> model_sizes_m;
};

// Fewest targets of a surface or datum on which anything is evaluated.
inline constexpr size_t kFewestFeatureTargets = 6;

// FailedPrecondition: the targets that are measured do not determine the measurand. Unimplemented:
// the surfaces or datums are not such as the characteristic is evaluated on; the message says why
// in words that go on from the characteristic's name. Feature::geometry is not looked at.
absl::StatusOr<CharacteristicFit> FitCharacteristic(const Feature& feature,
                                                    const Characteristic& characteristic);

}  // namespace sightline
