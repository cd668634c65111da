// SPDX-License-Identifier: Apache-2.0
// The drawing's tolerances as values: the width of each zone, its datums, the faces of the part
// that it binds, and the admissible uncertainty of a measurement that decides about it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/tolerance/nominal_face.h"

namespace sightline {

// Characteristics of ISO 1101:2017, table 2, of ASME Y14.5, and dimensions (ISO 14405).
enum class ToleranceKind {
  kFlatness,
  kStraightness,
  kRoundness,
  kCylindricity,
  kSurfaceProfile,
  kLineProfile,
  kPosition,
  kParallelism,
  kPerpendicularity,
  kAngularity,
  kConcentricity,
  kCoaxiality,
  kSymmetry,
  kCircularRunout,
  kTotalRunout,
  kLinearSize,       // of one feature: diameter, radius, thickness
  kAngularSize,      // of one feature: the angle of a cone
  kLinearDistance,   // between two features
  kAngularDistance,  // between two features
};

// "flatness", "linear size", ...
const char* ToleranceKindName(ToleranceKind kind);
// True for the size and distance of two angles: its limits are radians.
bool IsAngular(ToleranceKind kind);
// True for the four kinds of dimension.
bool IsDimension(ToleranceKind kind);

struct Tolerance {
  std::string id;    // in its file: "#57" (STEP), "12" (QIF)
  std::string name;  // as the file calls it; never empty
  // UUID that the characteristic has in every document about the part (QIF); empty: none is known.
  std::string persistent_id;
  ToleranceKind kind = ToleranceKind::kFlatness;
  // Full width s_t of the zone [m]; of a dimension upper - lower limit. 0 for angles.
  double zone_width_m = 0;
  // The same of an angle [rad]; 0 for all other kinds.
  double zone_width_rad = 0;
  // The zone is a cylinder, circle or sphere; its width is the diameter.
  bool diameter_zone = false;
  // Dimensions: nominal value and limits (not deviations), [m] or, of an angle, [rad].
  std::optional<double> nominal_m, lower_m, upper_m;
  std::optional<double> nominal_rad, lower_rad, upper_rad;
  // In order of precedence: "A", "B(M)", "C-D".
  std::vector<std::string> datums;
  // "maximum material requirement", "free state", "per 25.4 x 25.4 mm", ...
  std::vector<std::string> modifiers;
  // Faces of the STEP file, counted from 1 in the order in which they are imported; for QIF numbers
  // of ToleranceReport::nominal_faces.
  std::vector<int> faces;
  // Bound features in words if they are no faces of a STEP file: "cylinder Hole 3 (feature 17)".
  std::vector<std::string> features;
  // In words, with values and units as on a drawing: "position diameter 0.75 mm | A | B".
  std::string text;
};

struct Datum {
  std::string id;
  std::string letter;  // "A"; of a datum target "A1"
  bool target = false;
  std::vector<int> faces;
  std::vector<std::string> features;
};

struct UnreadTolerance {
  std::string name;  // name in the file, and its id
  std::string reason;
};

// The tolerances of a file. Each of the `entity_count` dimensions, tolerances and datums of the
// file is in exactly one of the four lists.
struct ToleranceReport {
  std::string file;
  std::string standard;  // "AP242" (or the older "AP203", "AP214"), "QIF 3.0"
  std::vector<Tolerance> read;
  // Dimensions read that have no limits of their own: theoretically exact, reference, or left to a
  // general tolerance. Their zone width is 0.
  std::vector<Tolerance> untoleranced;
  std::vector<Datum> datums;
  std::vector<UnreadTolerance> not_read;
  int entity_count = 0;
  // Nominal geometry of the features of a QIF file; empty for STEP, which has faces.
  std::vector<NominalFace> nominal_faces;
  // Notes for the reader: how the file was checked, where two ways of reading it disagree.
  std::vector<std::string> notes;
};

// ISO 14253-1:2017, 7: a value proves conformity only inside the zone reduced by the guard band
// g u at both limits.
struct DecisionRule {
  // g, coverage factor of the guard band. (0, 10]. ISO 14253-1:2017 has 1.65 as its default, the
  // thesis 2.
  double guard_factor = 2;
  // a, least part of the zone that the guard bands must leave for acceptance. [0, 1). At 0 the
  // acceptance zone may shrink to nothing, as in the thesis.
  double least_acceptance_zone = 0;
};

// Largest standard uncertainty u [m] of the measured quantity at which the zone left for
// acceptance, s_t - 2 g u, is at least a s_t:
//   u = s_t (1 - a) / (2 g);  g = 2, a = 0 give the thesis's s_t / 4 (section 3.1).
// `zone_width_m` > 0 and a rule that CheckDecisionRule accepts.
double AdmissibleUncertainty(double zone_width_m, const DecisionRule& rule);

// INVALID_ARGUMENT names the field, its value and its range.
absl::Status CheckDecisionRule(const DecisionRule& rule);

// Whether a tolerance can be planned for: INVALID_ARGUMENT names it, the value and the range if its
// zone has no width in metres (angles, dimensions without limits), is not finite, or is not smaller
// than `part_size_m`, the diagonal of the part's bounding box (a wrong unit, most likely).
absl::Status CheckTolerance(const Tolerance& tolerance, double part_size_m);

}  // namespace sightline
