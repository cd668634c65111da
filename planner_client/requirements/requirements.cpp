// SPDX-License-Identifier: Apache-2.0
#include "planner_client/requirements/requirements.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "planner_client/requirements/faces_on_part.h"

namespace sightline {
namespace {

// The triangles of some materials as one face.
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

absl::Status AddSurface(FaceTriangles face, const std::string& context,
                        std::vector<FaceSurface>* surfaces) {
  auto surface = FaceSurface::Make(std::move(face));
  if (!surface.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(context, ": ", surface.status().message()));
  }
  surfaces->push_back(*std::move(surface));
  return absl::OkStatus();
}

absl::StatusOr<TolerancedFeature> FeatureOfRegion(const TolerancedRegion& region,
                                                  const TriangleMesh& part,
                                                  const std::map<int, const FaceTriangles*>& faces,
                                                  FacesOnPart& on_part, const std::string& path) {
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
    absl::Status status =
        AddSurface(SurfaceOfMaterials(part, region.materials), path, &feature.faces);
    if (!status.ok()) return status;
  }
  for (const int number : region.faces) {
    const auto face = faces.find(number);
    if (face == faces.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ".faces: the file of tolerances has no face ", number));
    }
    if (absl::Status status = AddSurface(*face->second, path, &feature.faces); !status.ok()) {
      return status;
    }
    if (absl::Status on = on_part.Check(*face->second, path); !on.ok()) return on;
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
  if (absl::Status status = CheckDecisionRule(requirements.rule); !status.ok()) return status;
  requirements.default_zone_width_m = given.zone_width_m;
  const double part_size_m = part.BoundingBox().sizes().norm();
  const auto check_zone = [&](const std::string& path, double width_m) -> absl::Status {
    if (width_m < part_size_m) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        path, " is ", width_m, " m, must be below the part's size, ", part_size_m, " m"));
  };
  if (given.zone_width_m) {
    absl::Status status = check_zone("tolerances.zone_width_m", *given.zone_width_m);
    if (!status.ok()) return status;
  }
  std::map<int, const FaceTriangles*> by_number;
  for (const FaceTriangles& face : faces) by_number[face.face] = &face;
  FacesOnPart on_part(part);

  if (report) {
    requirements.left_out = report->not_read;
    for (const Tolerance& tolerance : report->read) {
      if (absl::Status status = CheckTolerance(tolerance, part_size_m); !status.ok()) {
        requirements.left_out.push_back({tolerance.name, std::string(status.message())});
        continue;
      }
      TolerancedFeature feature;
      feature.id = tolerance.id;
      feature.name = tolerance.name;
      feature.kind = tolerance.kind;
      feature.zone_width_m = tolerance.zone_width_m;
      feature.nominal_m = tolerance.nominal_m;
      feature.text = tolerance.text;
      for (const int number : tolerance.faces) {
        const auto face = by_number.find(number);
        if (face == by_number.end()) continue;
        const std::string binds = absl::StrCat(given.file, ": tolerance ", tolerance.name);
        absl::Status status = AddSurface(*face->second, binds, &feature.faces);
        if (!status.ok()) return status;
        if (status = on_part.Check(*face->second, binds); !status.ok()) return status;
      }
      if (feature.faces.empty()) {
        requirements.left_out.push_back(
            {tolerance.name, "it binds no face that the file gives the surface of"});
        continue;
      }
      requirements.features.push_back(std::move(feature));
      requirements.tolerances.push_back(tolerance);
    }
  }
  for (size_t i = 0; i < given.regions.size(); ++i) {
    const std::string path = absl::StrCat("tolerances.regions[", i, "]");
    absl::Status status = check_zone(path + ".zone_width_m", given.regions[i].zone_width_m);
    if (!status.ok()) return status;
    auto feature = FeatureOfRegion(given.regions[i], part, by_number, on_part, path);
    if (!feature.ok()) return feature.status();
    requirements.features.push_back(*std::move(feature));
  }
  if (requirements.features.empty() && !requirements.default_zone_width_m) {
    return absl::InvalidArgumentError(absl::StrCat(
        given.file, ": holds no tolerance that can be planned for (", requirements.left_out.size(),
        " are left out), and tolerances.zone_width_m is not given"));
  }

  double narrowest_m = given.zone_width_m.value_or(part_size_m);
  for (const TolerancedFeature& feature : requirements.features) {
    narrowest_m = std::min(narrowest_m, feature.zone_width_m);
  }
  requirements.relaxed_uncertainty_m = given.relaxed_uncertainty_m.value_or(
      std::min(10 * narrowest_m, 0.1 * inspection.uncertainty->prior_standard_deviation_m));
  return requirements;
}

}  // namespace sightline
