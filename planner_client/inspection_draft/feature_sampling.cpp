// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspection_draft/feature_sampling.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "core/inspection/vector_proto.h"
#include "core/targets/poisson_disk.h"

namespace sightline {
namespace {

TolerancedSurface SurfaceOf(const FaceTriangles& face, const std::string& name) {
  TolerancedSurface surface;
  surface.name = absl::StrCat("face ", face.face, ": ", name);
  for (const auto& triangle : face.triangles) {
    const Eigen::Vector3d& a = face.positions_m[triangle[0]];
    const Eigen::Vector3d& b = face.positions_m[triangle[1]];
    const Eigen::Vector3d& c = face.positions_m[triangle[2]];
    surface.area_m2 += 0.5 * (b - a).cross(c - a).norm();
    surface.box_m.extend(a).extend(b).extend(c);
  }
  return surface;
}

double TargetsOf(const TolerancedSurface& surface, double spacing_m) {
  return kTargetsPerSpacing2 * surface.area_m2 / (spacing_m * spacing_m);
}

v1::TargetRegion RegionOf(const TolerancedSurface& surface) {
  constexpr double kStep_m = 5e-5, kLeast_m = 1e-4;
  const double wished_m = std::sqrt(kTargetsPerSpacing2 * surface.area_m2 / kWishedFeatureTargets);
  // A product of whole numbers and 1e-5 is written with few digits.
  const double spacing_m =
      std::max(kLeast_m, 5 * std::floor(wished_m / kStep_m) / std::round(1 / 1e-5));
  v1::TargetRegion region;
  region.set_name(surface.name);
  // Targets lie on the mesh, up to the chord tolerance off the face.
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(FaceMatch{}.max_distance_m);
  const auto rounded = [](const Eigen::Vector3d& v) {
    return Eigen::Vector3d((v * 1e6).array().round() / 1e6);
  };
  *region.mutable_min_m() = VectorToProto(rounded(surface.box_m.min() - margin));
  *region.mutable_max_m() = VectorToProto(rounded(surface.box_m.max() + margin));
  region.set_spacing_m(spacing_m);
  return region;
}

}  // namespace

std::vector<TolerancedSurface> TolerancedSurfacesOf(const ToleranceReport& report,
                                                    std::span<const FaceTriangles> faces) {
  std::map<int, std::string> bound;  // first name of every face
  for (const Tolerance& tolerance : report.read) {
    for (const int face : tolerance.faces) bound.try_emplace(face, tolerance.name);
  }
  for (const Datum& datum : report.datums) {
    for (const int face : datum.faces) bound.try_emplace(face, "datum " + datum.letter);
  }
  std::vector<TolerancedSurface> surfaces;
  for (const FaceTriangles& face : faces) {
    const auto found = bound.find(face.face);
    if (found == bound.end()) continue;
    TolerancedSurface surface = SurfaceOf(face, found->second);
    if (surface.area_m2 > 0) surfaces.push_back(std::move(surface));
  }
  return surfaces;
}

std::vector<v1::TargetRegion> SampleFeatures(std::span<const TolerancedSurface> surfaces,
                                             double spacing_m) {
  std::vector<size_t> few;
  for (size_t i = 0; i < surfaces.size(); ++i) {
    if (TargetsOf(surfaces[i], spacing_m) < kWishedFeatureTargets) few.push_back(i);
  }
  if (few.size() > kMostSampledFeatures) {
    std::stable_sort(few.begin(), few.end(),
                     [&](size_t a, size_t b) { return surfaces[a].area_m2 < surfaces[b].area_m2; });
    few.resize(kMostSampledFeatures);
    std::sort(few.begin(), few.end());
  }
  std::vector<v1::TargetRegion> regions;
  for (const size_t i : few) regions.push_back(RegionOf(surfaces[i]));
  return regions;
}

}  // namespace sightline
