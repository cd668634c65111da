// SPDX-License-Identifier: Apache-2.0
#include "report/plan/surface/uncovered_regions.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/part/disjoint_sets.h"
#include "core/part/point_index.h"

namespace sightline {
namespace {

constexpr double kLinkSpacings = 2.0;
constexpr float kMinLinkCosine = -0.5f;

double SpacingOf(const TargetSet& targets, const TargetSampling& sampling, size_t i) {
  const int32_t region = targets.regions.empty() ? -1 : targets.regions[i];
  return region < 0 ? sampling.spacing_m : sampling.regions[region].spacing_m;
}

constexpr std::array<const char*, 6> kFaces = {"x\u2212", "x+", "y\u2212", "y+", "z\u2212", "z+"};

// kFaces of the axis that `normal` points along, or empty when it points between axes.
std::string FacingWords(const Eigen::Vector3d& normal) {
  if (normal.norm() < 0.4) return "facing all round";
  const Eigen::Vector3d n = normal.normalized();
  std::vector<std::string> axes;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(n[axis]) > 0.5) axes.push_back(kFaces[2 * axis + (n[axis] > 0)]);
  }
  if (axes.empty()) return "facing obliquely";
  std::string words = "facing " + axes[0];
  for (size_t i = 1; i < axes.size(); ++i) absl::StrAppend(&words, " and ", axes[i]);
  return words;
}

}  // namespace

std::vector<double> TargetAreaWeights(const TargetSet& targets, const TargetSampling& sampling) {
  std::vector<double> weights(targets.size());
  for (size_t i = 0; i < targets.size(); ++i) {
    const double spacing = SpacingOf(targets, sampling, i);
    weights[i] = spacing * spacing;
  }
  return weights;
}

std::vector<UncoveredRegion> FindUncoveredRegions(const TargetSet& targets,
                                                  const TargetSampling& sampling,
                                                  const TargetBits& selected) {
  assert(selected.size() == targets.size());
  std::vector<uint32_t> members;
  for (size_t i = 0; i < targets.size(); ++i) {
    if (selected.Test(i)) members.push_back(static_cast<uint32_t>(i));
  }
  if (members.empty()) return {};

  std::vector<Eigen::Vector3f> points;
  points.reserve(members.size());
  for (const uint32_t target : members) points.push_back(targets.positions_m[target]);
  const PointIndex<3> index(points);

  DisjointSets sets(members.size());
  for (uint32_t i = 0; i < members.size(); ++i) {
    // A pair is linked if either end reaches the other: the larger of the two spacings counts.
    const double radius_m = kLinkSpacings * SpacingOf(targets, sampling, members[i]);
    for (const uint32_t j : index.Within(points[i], radius_m)) {
      if (targets.normals[members[i]].dot(targets.normals[members[j]]) > kMinLinkCosine) {
        sets.Join(i, j);
      }
    }
  }

  const std::vector<double> weights = TargetAreaWeights(targets, sampling);
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  std::vector<UncoveredRegion> regions;
  std::vector<int64_t> region_of_root(members.size(), -1);
  for (uint32_t i = 0; i < members.size(); ++i) {
    int64_t& slot = region_of_root[sets.Find(i)];
    if (slot < 0) {
      slot = static_cast<int64_t>(regions.size());
      regions.emplace_back();
      regions.back().centroid_m.setZero();
      regions.back().mean_normal.setZero();
    }
    UncoveredRegion& region = regions[slot];
    const uint32_t target = members[i];
    region.targets.push_back(target);
    region.area_share += weights[target] / total;
    region.centroid_m += targets.positions_m[target].cast<double>();
    region.mean_normal += targets.normals[target].cast<double>();
    region.bounds_m.extend(targets.positions_m[target].cast<double>());
  }
  for (UncoveredRegion& region : regions) {
    region.centroid_m /= static_cast<double>(region.targets.size());
    region.mean_normal /= static_cast<double>(region.targets.size());
  }
  std::stable_sort(regions.begin(), regions.end(),
                   [](const UncoveredRegion& a, const UncoveredRegion& b) {
                     return a.area_share > b.area_share;
                   });
  return regions;
}

std::string DescribePlace(const UncoveredRegion& region, const Eigen::AlignedBox3d& part_bounds_m) {
  // Distance of the centroid from each face, in the order of kFaces.
  std::array<double, 6> depth_m;
  for (size_t axis = 0; axis < 3; ++axis) {
    depth_m[2 * axis] = region.centroid_m[axis] - part_bounds_m.min()[axis];
    depth_m[2 * axis + 1] = part_bounds_m.max()[axis] - region.centroid_m[axis];
  }
  const auto nearest = std::min_element(depth_m.begin(), depth_m.end()) - depth_m.begin();
  const auto face_name = [](long face) {
    if (face == 5) return std::string("top (z+)");
    if (face == 4) return std::string("bottom (z\u2212)");
    return absl::StrCat(kFaces[face], " side");
  };
  const auto millimetres = [](double length_m) {
    return absl::StrFormat("%.0f mm", std::abs(1e3 * length_m));
  };
  // Flush with a face of the bounding box up to the size of machining allowances.
  const double flush_m = 0.01 * part_bounds_m.sizes().maxCoeff();
  std::string words =
      depth_m[nearest] <= flush_m
          ? absl::StrCat("at the ", face_name(nearest))
          : absl::StrCat(millimetres(depth_m[nearest]), " inside the ", face_name(nearest));
  for (int axis = 2; axis >= 0; --axis) {
    if (axis == nearest / 2) continue;
    const size_t low = size_t{2} * axis;
    const size_t near_face = depth_m[low + 1] < depth_m[low] ? low + 1 : low;
    absl::StrAppend(&words, ", ", millimetres(depth_m[near_face]),
                    near_face == 5   ? " below the top"
                    : near_face == 4 ? " above the bottom"
                                     : absl::StrCat(" from ", kFaces[near_face]));
  }
  return absl::StrCat(words, ", ", FacingWords(region.mean_normal));
}

}  // namespace sightline
