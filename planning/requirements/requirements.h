// SPDX-License-Identifier: Apache-2.0
// Requirements of an inspection on its surfaces: toleranced features, and the uncertainty that is
// admissible at every target.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/association/nominal_surface.h"
#include "core/conformance/characteristic.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/targets/target_set.h"
#include "core/tolerance/face_surface.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

// A surface of the part with a tolerance.
struct TolerancedFeature {
  std::string id;    // in its file; "" by hand
  std::string name;  // never empty
  ToleranceKind kind = ToleranceKind::kSurfaceProfile;
  double zone_width_m = 0;    // > 0; 0 for an angle, which limits no single target
  double zone_width_rad = 0;  // of an angle
  std::optional<double> nominal_m;
  std::vector<std::string> datums;  // as Tolerance::datums
  MaterialRequirement material = MaterialRequirement::kNone;
  // Limits of the size of the same surfaces, for the material requirement.
  std::optional<double> smallest_size_m, nominal_size_m, largest_size_m;
  std::string text;  // as on the drawing
  // Its surfaces: a box in part coordinates or faces.
  std::optional<Eigen::AlignedBox3d> box_m;
  std::vector<FaceSurface> faces;
  bool by_material =
      false;  // the one face is all surface of some materials, not a face of the file
  // kChebyshev only where the inspection states it and the characteristic has a minimum zone.
  Association association = Association::kGauss;

  bool Contains(const Eigen::Vector3d& position_m, const Eigen::Vector3d& normal) const;
};

// A tolerance of the file that no surface can be evaluated by, and the reason.
struct UnboundTolerance {
  Tolerance tolerance;
  std::string reason;
};

struct Requirements {
  DecisionRule rule;
  Association association = Association::kGauss;  // as the inspection states it
  std::optional<double> default_zone_width_m;     // of targets without a feature
  double relaxed_uncertainty_m = 0;
  std::vector<TolerancedFeature> features;
  std::vector<UnboundTolerance> unbound;  // of the file: stated with a value, but not in features
  std::vector<Tolerance> tolerances;      // of the file: those of features, then the unbound ones
  std::vector<Datum> datums;              // of the file
  // Nominal surfaces of the faces that features and datums bind, and of datum faces, by
  // number.
  std::map<int, NominalSurface> nominal;
  std::vector<FaceSurface> datum_faces;
  // Tolerances of the file that cannot be planned for, with names and reasons. Tolerances that
  // could not be read are included.
  std::vector<UnreadTolerance> left_out;

  // Indices of a feature's targets, ascending.
  std::vector<uint32_t> TargetsOf(const TolerancedFeature& feature, const TargetSet& targets) const;
  // Admissible uncertainty of each target [m], by the narrowest zone that binds it; 0
  // without.
  std::vector<float> AdmissibleUncertainties(const TargetSet& targets) const;
};

// `report` and `faces` are those of inspection.tolerances.file, if there is one. INVALID_ARGUMENT
// names the region or tolerance: a material that the part does not have, a face that is not in the
// file or not on the part (FacesOnPart), a zone wider than the part, no tolerance at all, or the
// association CHEBYSHEV if no characteristic has a minimum zone.
absl::StatusOr<Requirements> MakeRequirements(const Inspection& inspection,
                                              const TriangleMesh& part,
                                              const std::optional<ToleranceReport>& report,
                                              const std::vector<FaceTriangles>& faces);

}  // namespace sightline
