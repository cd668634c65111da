// SPDX-License-Identifier: Apache-2.0
#include "core/registration/surface_index.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/part/surface_geometry.h"

namespace sightline {
namespace {

constexpr uint32_t kLeafTriangles = 4;
// Halves of at most 2^32 triangles are no deeper; a search holds at most one more per level.
constexpr size_t kMaxDepth = 34;
constexpr double kSameFaceCosine = 0.9396926;

}  // namespace

SurfaceIndex::SurfaceIndex(const TriangleMesh& mesh) : mesh_(mesh) {
  std::vector<Eigen::AlignedBox3d> boxes(mesh.triangles.size());
  normals_.reserve(mesh.triangles.size());
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    normals_.push_back(mesh.Normal(t));
    for (int corner = 0; corner < 3; ++corner) boxes[t].extend(mesh.Corner(t, corner));
    if (!normals_[t].isZero(0)) order_.push_back(static_cast<uint32_t>(t));
  }
  if (!order_.empty()) root_ = Divide(0, static_cast<uint32_t>(order_.size()), boxes);
}

uint32_t SurfaceIndex::Divide(uint32_t begin, uint32_t end,
                              const std::vector<Eigen::AlignedBox3d>& boxes) {
  Eigen::AlignedBox3d box, centres;
  for (uint32_t i = begin; i < end; ++i) {
    box.extend(boxes[order_[i]]);
    centres.extend(boxes[order_[i]].center());
  }
  if (end - begin <= kLeafTriangles) {
    nodes_.push_back({box, begin, end, true});
  } else {
    int axis = 0;
    centres.sizes().maxCoeff(&axis);
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                       const double at_a = boxes[a].center()[axis], at_b = boxes[b].center()[axis];
                       return at_a != at_b ? at_a < at_b : a < b;
                     });
    const uint32_t first = Divide(begin, middle, boxes);
    const uint32_t second = Divide(middle, end, boxes);
    nodes_.push_back({box, first, second, false});
  }
  return static_cast<uint32_t>(nodes_.size() - 1);
}

bool SurfaceIndex::OnOneFace(const SurfacePoint& on, double radius_m) const {
  const auto [u, v] = TangentAxes(on.normal);
  for (const Eigen::Vector3d& along : {u, v}) {
    for (const double side : {-radius_m, radius_m}) {
      const auto near =
          Nearest(on.position_m + side * along, Eigen::Vector3d::Zero(), 0.2 * radius_m);
      if (!near || near->normal.dot(on.normal) < kSameFaceCosine) return false;
    }
  }
  return true;
}

bool SurfaceIndex::NoOtherFaceAlong(const Eigen::Vector3d& point_m, const Eigen::Vector3d& step_m,
                                    int steps, const SurfacePoint& on,
                                    const Eigen::Vector3d& facing) const {
  const double length_m = step_m.norm();
  const auto other = [&](uint32_t t, const Eigen::Vector3d& nearest_m) {
    return normals_[t].dot(on.normal) < kSameFaceCosine ||
           std::abs(on.Deviation(nearest_m)) > 0.25 * length_m;
  };
  for (int k = -steps; k <= steps; ++k) {
    if (Search(point_m + k * step_m, facing, 0.5 * length_m, other)) return false;
  }
  return true;
}

std::optional<SurfacePoint> SurfaceIndex::Nearest(const Eigen::Vector3d& point_m,
                                                  const Eigen::Vector3d& facing,
                                                  double reach_m) const {
  return Search(point_m, facing, reach_m, [](uint32_t, const Eigen::Vector3d&) { return true; });
}

template <typename Candidate>
std::optional<SurfacePoint> SurfaceIndex::Search(const Eigen::Vector3d& point_m,
                                                 const Eigen::Vector3d& facing, double reach_m,
                                                 const Candidate& candidate) const {
  std::optional<SurfacePoint> best;
  if (order_.empty()) return best;
  double best_m2 = reach_m * reach_m;
  std::array<std::pair<uint32_t, double>, 2 * kMaxDepth> open;  // nodes and how near they come
  size_t open_count = 0;
  const auto distance_m2 = [&](uint32_t node) {
    return nodes_[node].box.squaredExteriorDistance(point_m);
  };
  open[open_count++] = {root_, distance_m2(root_)};
  while (open_count > 0) {
    const auto [at, near_m2] = open[--open_count];
    if (near_m2 > best_m2) continue;
    const Node& node = nodes_[at];
    if (!node.leaf) {
      const std::pair<uint32_t, double> first = {node.begin, distance_m2(node.begin)};
      const std::pair<uint32_t, double> second = {node.end, distance_m2(node.end)};
      // The nearer one is looked at first.
      const bool swapped = first.second < second.second;
      open[open_count++] = swapped ? second : first;
      open[open_count++] = swapped ? first : second;
      continue;
    }
    for (uint32_t i = node.begin; i < node.end; ++i) {
      const uint32_t t = order_[i];
      if (normals_[t].dot(facing) < 0) continue;
      const Eigen::Vector3d on = ClosestOnTriangle<double>(point_m, mesh_.Corner(t, 0),
                                                           mesh_.Corner(t, 1), mesh_.Corner(t, 2));
      const double m2 = (point_m - on).squaredNorm();
      if (m2 > best_m2 || (best && m2 == best_m2 && t > best->triangle)) continue;
      if (!candidate(t, on)) continue;
      best_m2 = m2;
      best = SurfacePoint{t, on, normals_[t], std::sqrt(m2)};
    }
  }
  return best;
}

}  // namespace sightline
