// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/requirements.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "planning/requirements/faces_on_part.h"

namespace sightline {
namespace {

// All triangles of some materials as one face.
FaceTriangles SurfaceOfMaterials(const TriangleMesh& part, const std::vector<std::string>& names) {
  FaceTriangles face{1, {}, {}};
  for (size_t t = 0; t < part.triangles.size(); ++t) {
    if (part.triangle_material.empty()) break;
    const std::string& material = part.material_names[part.triangle_material[t]];
    if (std::find(names.begin(), names.end(), material) == names.end()) continue;
    const auto first = static_cast<uint32_t>(face.positions_m.size());
    for (int c = 0; c < 3; ++c) face.positions_m.push_back(part.Corner(t, c));
    face.triangles.push_back({first, first + 1, first + 2});
  }
  return face;
}

// The nominal surface through the vertices of a face.
NominalSurface NominalOf(const FaceTriangles& face) {
  constexpr size_t kMostPoints = 400;
  std::vector<Eigen::Vector3d> sums(face.positions_m.size(), Eigen::Vector3d::Zero());
  for (const auto& triangle : face.triangles) {
    const Eigen::Vector3d normal =
        (face.positions_m[triangle[1]] - face.positions_m[triangle[0]])
            .cross(face.positions_m[triangle[2]] - face.positions_m[triangle[0]]);
    for (const uint32_t corner : triangle) sums[corner] += normal;
  }
  std::vector<Eigen::Vector3d> points, normals;
  const size_t stride = face.positions_m.size() / kMostPoints + 1;
  for (size_t i = 0; i < face.positions_m.size(); i += stride) {
    if (!(sums[i].norm() > 0)) continue;
    points.push_back(face.positions_m[i]);
    normals.push_back(sums[i].normalized());
  }
  return RecogniseSurface(points, normals);
}

void AddNominal(const FaceTriangles& face, Requirements* requirements) {
  const auto [entry, fresh] = requirements->nominal.try_emplace(face.face);
  if (fresh) entry->second = NominalOf(face);
}

absl::Status AddSurface(FaceTriangles face, const std::string& context,
                        std::vector<FaceSurface>* surfaces) {
  auto surface = FaceSurface::Make(std::move(face));
  if (!surface.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": ", surface.status().message()));
  }
  surfaces->push_back(*std::move(surface));
  return absl::OkStatus();
}

// Adds the size limits of the same surfaces, if a tolerance states them.
void AddSizeLimits(const Tolerance& tolerance, const ToleranceReport& report,
                   TolerancedFeature* feature) {
  for (const Tolerance& size : report.read) {
    if (size.kind != ToleranceKind::kLinearSize || !size.nominal_m || !size.lower_m ||
        !size.upper_m || !(*size.lower_m < *size.upper_m)) {
      continue;
    }
    const bool shared = std::any_of(size.faces.begin(), size.faces.end(), [&](int face) {
      return std::find(tolerance.faces.begin(), tolerance.faces.end(), face) !=
             tolerance.faces.end();
    });
    if (!shared) continue;
    feature->smallest_size_m = size.lower_m;
    feature->nominal_size_m = size.nominal_m;
    feature->largest_size_m = size.upper_m;
    return;
  }
}

bool HasModifier(const Tolerance& tolerance, const std::string& modifier) {
  return std::find(tolerance.modifiers.begin(), tolerance.modifiers.end(), modifier) !=
         tolerance.modifiers.end();
}

using FacesByNumber = std::map<int, const FaceTriangles*>;

// Adds a tolerance of the file as a feature, or to the tolerances that cannot be planned for.
absl::Status AddTolerance(const Tolerance& tolerance, const ToleranceReport& report,
                          const std::string& file, double part_size_m,
                          const FacesByNumber& by_number, FacesOnPart& on_part,
                          Requirements* requirements) {
  const auto leave_out = [&](const std::string& reason) {
    requirements->left_out.push_back({tolerance.name, reason});
    requirements->unbound.push_back({tolerance, reason});
    return absl::OkStatus();
  };
  const bool angle = IsAngular(tolerance.kind) && tolerance.zone_width_rad > 0;
  if (!angle) {
    if (absl::Status status = CheckTolerance(tolerance, part_size_m); !status.ok()) {
      return leave_out(std::string(status.message()));
    }
  }
  TolerancedFeature feature;
  feature.id = tolerance.id;
  feature.name = tolerance.name;
  feature.kind = tolerance.kind;
  feature.zone_width_m = angle ? 0 : tolerance.zone_width_m;
  feature.zone_width_rad = tolerance.zone_width_rad;
  feature.nominal_m = tolerance.nominal_m;
  feature.text = tolerance.text;
  feature.datums = tolerance.datums;
  if (HasMinimumZone(feature.kind, !feature.datums.empty())) {
    feature.association = requirements->association;
  }
  if (HasModifier(tolerance, "maximum material requirement")) {
    feature.material = MaterialRequirement::kMaximum;
  } else if (HasModifier(tolerance, "least material requirement")) {
    feature.material = MaterialRequirement::kLeast;
  }
  AddSizeLimits(tolerance, report, &feature);
  for (const int number : tolerance.faces) {
    const auto face = by_number.find(number);
    if (face == by_number.end()) {
      const auto missed = std::find_if(report.nominal_faces.begin(), report.nominal_faces.end(),
                                       [&](const NominalFace& f) { return f.face == number; });
      if (missed == report.nominal_faces.end()) continue;
      return leave_out(
          absl::StrCat(missed->feature, missed->surface.kind == SurfaceKind::kFreeform
                                            ? " has no nominal surface"
                                            : " does not lie on the part as a whole within 10 um"));
    }
    const std::string binds = absl::StrCat(file, ": tolerance ", tolerance.name);
    SIGHTLINE_RETURN_IF_ERROR(AddSurface(*face->second, binds, &feature.faces));
    SIGHTLINE_RETURN_IF_ERROR(on_part.Check(*face->second, binds));
    AddNominal(*face->second, requirements);
  }
  if (feature.faces.empty()) {
    return leave_out("it binds no face whose surface is in the file");
  }
  requirements->features.push_back(std::move(feature));
  requirements->tolerances.push_back(tolerance);
  return absl::OkStatus();
}

absl::Status AddDatumFaces(const FacesByNumber& by_number, FacesOnPart& on_part,
                           Requirements* requirements) {
  std::set<int> added;
  for (const Datum& datum : requirements->datums) {
    for (const int number : datum.faces) {
      const auto face = by_number.find(number);
      if (face == by_number.end() || !added.insert(number).second) continue;
      const std::string binds = absl::StrCat("datum ", datum.letter);
      SIGHTLINE_RETURN_IF_ERROR(AddSurface(*face->second, binds, &requirements->datum_faces));
      SIGHTLINE_RETURN_IF_ERROR(on_part.Check(*face->second, binds));
      AddNominal(*face->second, requirements);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<TolerancedFeature> FeatureOfRegion(const TolerancedRegion& region,
                                                  const TriangleMesh& part,
                                                  const std::map<int, const FaceTriangles*>& faces,
                                                  FacesOnPart& on_part, const std::string& path,
                                                  Requirements* requirements) {
  TolerancedFeature feature;
  feature.name = region.name;
  feature.zone_width_m = region.zone_width_m;
  feature.box_m = region.box_m;
  for (const std::string& material : region.materials) {
    if (std::find(part.material_names.begin(), part.material_names.end(), material) !=
        part.material_names.end()) {
      continue;
    }
    return absl::InvalidArgumentError(absl::StrCat(
        path, ".materials: the part has no material \"", material, "\"; it has ",
        part.material_names.empty() ? "none" : absl::StrJoin(part.material_names, ", ")));
  }
  if (!region.materials.empty()) {
    feature.by_material = true;
    SIGHTLINE_RETURN_IF_ERROR(
        AddSurface(SurfaceOfMaterials(part, region.materials), path, &feature.faces));
  }
  for (const int number : region.faces) {
    const auto face = faces.find(number);
    if (face == faces.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ".faces: the file of tolerances has no face ", number));
    }
    SIGHTLINE_RETURN_IF_ERROR(AddSurface(*face->second, path, &feature.faces));
    SIGHTLINE_RETURN_IF_ERROR(on_part.Check(*face->second, path));
    AddNominal(*face->second, requirements);
  }
  return feature;
}

}  // namespace

bool TolerancedFeature::Contains(const Eigen::Vector3d& position_m,
                                 const Eigen::Vector3d& normal) const {
  if (box_m) return box_m->contains(position_m);
  return std::any_of(faces.begin(), faces.end(),
                     [&](const FaceSurface& face) { return face.Contains(position_m, normal); });
}

std::vector<uint32_t> Requirements::TargetsOf(const TolerancedFeature& feature,
                                              const TargetSet& targets) const {
  std::vector<uint32_t> result;
  for (size_t t = 0; t < targets.size(); ++t) {
    if (feature.Contains(targets.positions_m[t].cast<double>(),
                         targets.normals[t].cast<double>())) {
      result.push_back(static_cast<uint32_t>(t));
    }
  }
  return result;
}

std::vector<float> Requirements::AdmissibleUncertainties(const TargetSet& targets) const {
  const float default_m =
      default_zone_width_m ? static_cast<float>(AdmissibleUncertainty(*default_zone_width_m, rule))
                           : 0.0f;
  std::vector<float> result(targets.size(), 0);
  for (const TolerancedFeature& feature : features) {
    if (!(feature.zone_width_m > 0)) continue;
    const auto admissible_m = static_cast<float>(AdmissibleUncertainty(feature.zone_width_m, rule));
    for (const uint32_t t : TargetsOf(feature, targets)) {
      result[t] = result[t] > 0 ? std::min(result[t], admissible_m) : admissible_m;
    }
  }
  for (float& admissible_m : result) {
    if (admissible_m == 0) admissible_m = default_m;
  }
  return result;
}

absl::StatusOr<Requirements> MakeRequirements(const Inspection& inspection,
                                              const TriangleMesh& part,
                                              const std::optional<ToleranceReport>& report,
                                              const std::vector<FaceTriangles>& faces) {
  const ToleranceRequirements& given = *inspection.tolerances;
  Requirements requirements;
  requirements.rule = {given.guard_factor, given.least_acceptance_zone};
  requirements.association = given.association;
  SIGHTLINE_RETURN_IF_ERROR(CheckDecisionRule(requirements.rule));
  requirements.default_zone_width_m = given.zone_width_m;
  const double part_size_m = part.BoundingBox().sizes().norm();
  const auto check_zone = [&](const std::string& path, double width_m) -> absl::Status {
    if (width_m < part_size_m) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        path, " is ", width_m, " m, must be below the part's size, ", part_size_m, " m"));
  };
  if (given.zone_width_m) {
    SIGHTLINE_RETURN_IF_ERROR(check_zone("tolerances.zone_width_m", *given.zone_width_m));
  }
  std::map<int, const FaceTriangles*> by_number;
  for (const FaceTriangles& face : faces) by_number[face.face] = &face;
  FacesOnPart on_part(part);

  if (report) {
    requirements.left_out = report->not_read;
    requirements.datums = report->datums;
    for (const Tolerance& tolerance : report->read) {
      SIGHTLINE_RETURN_IF_ERROR(AddTolerance(tolerance, *report, given.file, part_size_m, by_number,
                                             on_part, &requirements));
    }
    SIGHTLINE_RETURN_IF_ERROR(AddDatumFaces(by_number, on_part, &requirements));
    for (const UnboundTolerance& unbound : requirements.unbound) {
      requirements.tolerances.push_back(unbound.tolerance);
    }
  }
  for (size_t i = 0; i < given.regions.size(); ++i) {
    const std::string path = absl::StrCat("tolerances.regions[", i, "]");
    SIGHTLINE_RETURN_IF_ERROR(check_zone(path + ".zone_width_m", given.regions[i].zone_width_m));
    SIGHTLINE_ASSIGN_OR_RETURN(auto feature, FeatureOfRegion(given.regions[i], part, by_number,
                                                             on_part, path, &requirements));
    requirements.features.push_back(std::move(feature));
  }
  // Angles do not limit single targets, so no scans can be planned for angles alone.
  const bool any_zone = std::any_of(requirements.features.begin(), requirements.features.end(),
                                    [](const auto& feature) { return feature.zone_width_m > 0; });
  if (!any_zone && !requirements.default_zone_width_m) {
    return absl::InvalidArgumentError(absl::StrCat(
        given.file, ": holds no tolerance that can be planned for (", requirements.left_out.size(),
        " are left out), and tolerances.zone_width_m is not given"));
  }

  const bool any_minimum_zone =
      std::any_of(requirements.features.begin(), requirements.features.end(),
                  [](const auto& f) { return f.association == Association::kChebyshev; });
  if (given.association == Association::kChebyshev && !any_minimum_zone) {
    return absl::InvalidArgumentError(
        "tolerances.association is CHEBYSHEV: no tolerance of tolerances.file is of form or a "
        "profile without datums, and others are evaluated by least squares (GAUSS)");
  }
  if (inspection.uncertainty->registration == RegistrationMethod::kDatumFeatures &&
      requirements.datum_faces.empty()) {
    return absl::InvalidArgumentError(
        "uncertainty.registration is DATUM_FEATURES: the tolerances name no datum with a face");
  }
  double narrowest_m = given.zone_width_m.value_or(part_size_m);
  for (const TolerancedFeature& feature : requirements.features) {
    if (!(feature.zone_width_m > 0)) continue;
    narrowest_m = std::min(narrowest_m, feature.zone_width_m);
  }
  requirements.relaxed_uncertainty_m = given.relaxed_uncertainty_m.value_or(
      std::min(10 * narrowest_m, 0.1 * inspection.uncertainty->prior_standard_deviation_m));
  return requirements;
}

}  // namespace sightline
