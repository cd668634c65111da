// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/occlusion/triangle_bvh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/cpu/function_clones.h"

namespace sightline {
namespace {

using Lanes = float __attribute__((vector_size(4 * TriangleBvh::kLanes)));
using LaneMask = int __attribute__((vector_size(4 * TriangleBvh::kLanes)));

Lanes Load(const float* values) {
  Lanes lanes;
  __builtin_memcpy(&lanes, values, sizeof(lanes));
  return lanes;
}

uint32_t Bits(LaneMask mask) {
  uint32_t bits = 0;
  for (int i = 0; i < TriangleBvh::kLanes; ++i) bits |= static_cast<uint32_t>(mask[i] & 1) << i;
  return bits;
}

Lanes Min(Lanes a, Lanes b) { return a < b ? a : b; }
Lanes Max(Lanes a, Lanes b) { return a > b ? a : b; }

double TriangleSpan(const Eigen::Vector3d* corners, const Eigen::Vector3d& axis, double& low,
                    double& high) {
  const double a = corners[0].dot(axis), b = corners[1].dot(axis), c = corners[2].dot(axis);
  low = std::min({a, b, c});
  high = std::max({a, b, c});
  return high - low;
}

}  // namespace

TriangleBvh::TriangleBvh(const TriangleMesh& mesh, const std::atomic<bool>* cancelled) {
  Build(mesh, cancelled);
  if (cancelled == nullptr || !cancelled->load()) return;
  nodes_.clear();
  triangles_.clear();
}

void TriangleBvh::Build(const TriangleMesh& mesh, const std::atomic<bool>* cancelled) {
  // Called for every triangle and level; reads the flag only at every 65536th call.
  auto stopped = [cancelled, asked = 0u]() mutable {
    return cancelled != nullptr && ++asked % (1 << 16) == 0 &&
           cancelled->load(std::memory_order_relaxed);
  };
  const size_t count = mesh.triangles.size();
  std::vector<Eigen::AlignedBox3f> boxes;
  std::vector<Eigen::Vector3f> centres;
  boxes.reserve(count);
  centres.reserve(count);
  for (size_t t = 0; t < count; ++t) {
    if (stopped()) return;
    Eigen::AlignedBox3f& box = boxes.emplace_back();
    for (int c = 0; c < 3; ++c) box.extend(mesh.positions_m[mesh.triangles[t][c]]);
    centres.push_back(box.center());
    bounds_.extend(box);
  }
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);

  nodes_.reserve(2 * count / 2 + 2);
  nodes_.push_back({});
  struct Task {
    uint32_t node, begin, end;
    int depth;
  };
  std::vector<Task> stack = {{0, 0, static_cast<uint32_t>(count), 0}};
  // Nodes below this depth are halved by count, so that a traversal stack of 64 always suffices.
  constexpr int kMaxSahDepth = 30;
  constexpr uint32_t kLeafSize = 4;
  constexpr int kBins = 16;
  while (!stack.empty()) {
    const Task task = stack.back();
    stack.pop_back();
    Eigen::AlignedBox3f box, centre_box;
    for (uint32_t i = task.begin; i < task.end; ++i) {
      if (stopped()) return;
      box.extend(boxes[order[i]]);
      centre_box.extend(centres[order[i]]);
    }
    Node& node = nodes_[task.node];
    for (int k = 0; k < 3; ++k) {
      node.min[k] = task.begin < task.end ? box.min()[k] : 0;
      node.max[k] = task.begin < task.end ? box.max()[k] : 0;
    }
    node.first = task.begin;
    node.count = task.end - task.begin;
    if (node.count <= kLeafSize) continue;

    // Binned surface-area heuristic (Wald 2007).
    float best_cost = std::numeric_limits<float>::infinity();
    int best_axis = -1, best_bin = 0;
    for (int axis = 0; axis < 3 && task.depth < kMaxSahDepth; ++axis) {
      const float low = centre_box.min()[axis], size = centre_box.sizes()[axis];
      if (size <= 0) continue;
      std::array<Eigen::AlignedBox3f, kBins> bin_box;
      std::array<uint32_t, kBins> bin_count{};
      for (uint32_t i = task.begin; i < task.end; ++i) {
        if (stopped()) return;
        const int bin =
            std::min(kBins - 1, static_cast<int>(kBins * (centres[order[i]][axis] - low) / size));
        bin_box[bin].extend(boxes[order[i]]);
        ++bin_count[bin];
      }
      const auto area = [](const Eigen::AlignedBox3f& b) {
        if (b.isEmpty()) return 0.0f;
        const Eigen::Vector3f s = b.sizes();
        return s.x() * s.y() + s.y() * s.z() + s.z() * s.x();
      };
      std::array<float, kBins> right_cost{};
      Eigen::AlignedBox3f sweep;
      uint32_t sweep_count = 0;
      for (int b = kBins - 1; b > 0; --b) {
        sweep.extend(bin_box[b]);
        sweep_count += bin_count[b];
        right_cost[b] = area(sweep) * sweep_count;
      }
      sweep.setEmpty();
      sweep_count = 0;
      for (int b = 0; b + 1 < kBins; ++b) {
        sweep.extend(bin_box[b]);
        sweep_count += bin_count[b];
        const float cost = area(sweep) * sweep_count + right_cost[b + 1];
        if (sweep_count > 0 && sweep_count < node.count && cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = b;
        }
      }
    }
    uint32_t middle;
    if (best_axis >= 0) {
      const float low = centre_box.min()[best_axis], size = centre_box.sizes()[best_axis];
      bool stop = false;
      const auto it =
          std::partition(order.begin() + task.begin, order.begin() + task.end, [&](uint32_t t) {
            stop = stop || stopped();
            if (stop) return true;
            return std::min(kBins - 1, static_cast<int>(kBins * (centres[t][best_axis] - low) /
                                                        size)) <= best_bin;
          });
      if (stop) return;
      middle = static_cast<uint32_t>(it - order.begin());
    } else {
      middle = task.begin + nodes_[task.node].count / 2;
    }
    const uint32_t left = static_cast<uint32_t>(nodes_.size());
    nodes_[task.node].first = left;
    nodes_[task.node].count = 0;
    nodes_.push_back({});
    nodes_.push_back({});
    stack.push_back({left + 1, middle, task.end, task.depth + 1});
    stack.push_back({left, task.begin, middle, task.depth + 1});
  }

  triangles_.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    if (stopped()) return;
    Triangle& triangle = triangles_.emplace_back();
    const auto& corners = mesh.triangles[order[i]];
    const Eigen::Vector3f a = mesh.positions_m[corners[0]];
    const Eigen::Vector3f e1 = mesh.positions_m[corners[1]] - a;
    const Eigen::Vector3f e2 = mesh.positions_m[corners[2]] - a;
    for (int k = 0; k < 3; ++k) {
      triangle.v[k] = a[k];
      triangle.e1[k] = e1[k];
      triangle.e2[k] = e2[k];
    }
    triangle.index = order[i];
  }
}

size_t TriangleBvh::bytes() const {
  return nodes_.capacity() * sizeof(Node) + triangles_.capacity() * sizeof(Triangle);
}

SIGHTLINE_CLONES("avx2")
uint32_t TriangleBvh::Occluded(const Eigen::Vector3f& from, const Bundle& bundle,
                               uint32_t active) const {
  if (triangles_.empty() || active == 0) return 0;
  const Lanes dx = Load(bundle.to_x) - from.x();
  const Lanes dy = Load(bundle.to_y) - from.y();
  const Lanes dz = Load(bundle.to_z) - from.z();
  const Lanes one = Lanes{} + 1.0f;
  const Lanes t_max = one - Load(bundle.gap);
  // Directions of exactly zero would give NaN slabs.
  const auto inverse = [&](Lanes d) {
    const Lanes tiny = Lanes{} + 1e-20f;
    return one / ((d < tiny) & (d > -tiny) ? tiny : d);
  };
  const Lanes ix = inverse(dx), iy = inverse(dy), iz = inverse(dz);

  uint32_t occluded = 0;
  uint32_t stack[64];
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    const Lanes x0 = (node.min[0] - from.x()) * ix, x1 = (node.max[0] - from.x()) * ix;
    const Lanes y0 = (node.min[1] - from.y()) * iy, y1 = (node.max[1] - from.y()) * iy;
    const Lanes z0 = (node.min[2] - from.z()) * iz, z1 = (node.max[2] - from.z()) * iz;
    const Lanes near = Max(Max(Min(x0, x1), Min(y0, y1)), Max(Min(z0, z1), Lanes{}));
    const Lanes far = Min(Min(Max(x0, x1), Max(y0, y1)), Min(Max(z0, z1), t_max));
    // A few ulps of slack so that flat boxes are not missed.
    if ((Bits(near <= far * 1.000001f) & active & ~occluded) == 0) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& tri = triangles_[i];
      // Moeller-Trumbore without division: compare against the determinant.
      const Lanes px = dy * tri.e2[2] - dz * tri.e2[1];
      const Lanes py = dz * tri.e2[0] - dx * tri.e2[2];
      const Lanes pz = dx * tri.e2[1] - dy * tri.e2[0];
      const Lanes det = tri.e1[0] * px + tri.e1[1] * py + tri.e1[2] * pz;
      const float sx = from.x() - tri.v[0], sy = from.y() - tri.v[1], sz = from.z() - tri.v[2];
      const Lanes u = sx * px + sy * py + sz * pz;
      const float qx = sy * tri.e1[2] - sz * tri.e1[1];
      const float qy = sz * tri.e1[0] - sx * tri.e1[2];
      const float qz = sx * tri.e1[1] - sy * tri.e1[0];
      const Lanes v = dx * qx + dy * qy + dz * qz;
      const float tq = tri.e2[0] * qx + tri.e2[1] * qy + tri.e2[2] * qz;
      const Lanes sign = det < Lanes{} ? -one : one;
      const Lanes d = det * sign, us = u * sign, vs = v * sign, ts = tq * sign;
      const LaneMask hit = (d > Lanes{}) & (us >= Lanes{}) & (vs >= Lanes{}) & (us + vs <= d) &
                           (ts > Lanes{}) & (ts < d * t_max);
      occluded |= Bits(hit) & active;
    }
    if ((active & ~occluded) == 0) break;
  }
  return occluded;
}

bool TriangleBvh::Occluded(const Eigen::Vector3f& from, const Eigen::Vector3f& to,
                           float gap_m) const {
  Bundle bundle;
  const float length = (to - from).norm();
  for (int i = 0; i < kLanes; ++i) {
    bundle.to_x[i] = to.x();
    bundle.to_y[i] = to.y();
    bundle.to_z[i] = to.z();
    bundle.gap[i] = length > 0 ? gap_m / length : 1.0f;
  }
  return Occluded(from, bundle, 1) != 0;
}

template <typename Visit>
bool TriangleBvh::AnyInBox(const Eigen::AlignedBox3f& box, const Visit& visit) const {
  if (triangles_.empty()) return false;
  uint32_t stack[64];
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    bool apart = false;
    for (int k = 0; k < 3; ++k) {
      apart |= node.min[k] > box.max()[k] || node.max[k] < box.min()[k];
    }
    if (apart) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (visit(triangles_[i])) return true;
    }
  }
  return false;
}

void TriangleBvh::VisitBox(const Eigen::AlignedBox3f& box,
                           const std::function<void(uint32_t)>& visit) const {
  AnyInBox(box, [&](const Triangle& triangle) {
    visit(triangle.index);
    return false;
  });
}

bool TriangleBvh::Touches(const TriangleBvh& other, const Eigen::Matrix3d& rotation,
                          const Eigen::Vector3d& shift, const Eigen::Vector3d& half_sweep) const {
  for (const Triangle& theirs : other.triangles_) {
    const Eigen::Vector3d v =
        rotation * Eigen::Vector3d(theirs.v[0], theirs.v[1], theirs.v[2]) + shift;
    const Eigen::Vector3d e1 = rotation * Eigen::Vector3d(theirs.e1[0], theirs.e1[1], theirs.e1[2]);
    const Eigen::Vector3d e2 = rotation * Eigen::Vector3d(theirs.e2[0], theirs.e2[1], theirs.e2[2]);
    const Eigen::Vector3d swept[3] = {v, v + e1, v + e2};
    const Eigen::Vector3d edges[4] = {e1, e2, e2 - e1, half_sweep};
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3d& corner : swept) {
      box.extend((corner + half_sweep).cast<float>());
      box.extend((corner - half_sweep).cast<float>());
    }
    const bool touches = AnyInBox(box, [&](const Triangle& ours) {
      const Eigen::Vector3d w(ours.v[0], ours.v[1], ours.v[2]);
      const Eigen::Vector3d f1(ours.e1[0], ours.e1[1], ours.e1[2]);
      const Eigen::Vector3d f2(ours.e2[0], ours.e2[1], ours.e2[2]);
      const Eigen::Vector3d still[3] = {w, w + f1, w + f2};
      const auto separates = [&](const Eigen::Vector3d& axis) {
        if (axis.squaredNorm() < 1e-24) return false;
        double a, b, c, d;
        TriangleSpan(swept, axis, a, b);
        TriangleSpan(still, axis, c, d);
        const double reach = std::abs(half_sweep.dot(axis));
        return a - reach > d || b + reach < c;
      };
      // Facets of the swept triangle (a prism), the other triangle's plane, and pairs of edges.
      if (separates(f1.cross(f2))) return false;
      for (int i = 0; i < 4; ++i) {
        for (int j = i + 1; j < 4; ++j) {
          if (separates(edges[i].cross(edges[j]))) return false;
        }
        for (const Eigen::Vector3d& f : {f1, f2, Eigen::Vector3d(f2 - f1)}) {
          if (separates(edges[i].cross(f))) return false;
        }
      }
      return true;
    });
    if (touches) return true;
  }
  return false;
}

bool TriangleBvh::Overlaps(const Zonotope& solid) const {
  if (triangles_.empty()) return false;
  const Eigen::Vector3d extent(solid.HalfExtent(Eigen::Vector3d::UnitX()),
                               solid.HalfExtent(Eigen::Vector3d::UnitY()),
                               solid.HalfExtent(Eigen::Vector3d::UnitZ()));
  const Eigen::Vector3d low = solid.centre_m - extent, high = solid.centre_m + extent;

  // Facet normals of a zonotope are the cross products of its generators.
  std::vector<Eigen::Vector3d> facets;
  for (size_t i = 0; i < solid.generators_m.size(); ++i) {
    for (size_t j = i + 1; j < solid.generators_m.size(); ++j) {
      const Eigen::Vector3d axis = solid.generators_m[i].cross(solid.generators_m[j]);
      if (axis.squaredNorm() > 1e-18) facets.push_back(axis.normalized());
    }
  }
  std::vector<double> facet_centre, facet_extent;
  for (const auto& axis : facets) {
    facet_centre.push_back(axis.dot(solid.centre_m));
    facet_extent.push_back(solid.HalfExtent(axis));
  }

  const auto touches = [&](const Triangle& tri) {
    const Eigen::Vector3d v(tri.v[0], tri.v[1], tri.v[2]);
    const Eigen::Vector3d e1(tri.e1[0], tri.e1[1], tri.e1[2]);
    const Eigen::Vector3d e2(tri.e2[0], tri.e2[1], tri.e2[2]);
    const Eigen::Vector3d corners[3] = {v, v + e1, v + e2};
    double a, b;
    for (size_t f = 0; f < facets.size(); ++f) {
      TriangleSpan(corners, facets[f], a, b);
      if (a > facet_centre[f] + facet_extent[f] || b < facet_centre[f] - facet_extent[f]) {
        return false;
      }
    }
    const auto separates = [&](const Eigen::Vector3d& axis) {
      if (axis.squaredNorm() < 1e-24) return false;
      TriangleSpan(corners, axis, a, b);
      const double centre = axis.dot(solid.centre_m), half = solid.HalfExtent(axis);
      return a > centre + half || b < centre - half;
    };
    if (separates(e1.cross(e2))) return false;
    for (const auto& g : solid.generators_m) {
      for (const Eigen::Vector3d& e : {e1, e2, Eigen::Vector3d(e2 - e1)}) {
        if (separates(g.cross(e))) return false;
      }
    }
    return true;
  };

  uint32_t stack[64];
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    bool apart = false;
    for (int k = 0; k < 3; ++k) apart |= node.min[k] > high[k] || node.max[k] < low[k];
    if (apart) continue;
    const Eigen::Vector3d centre(0.5 * (node.min[0] + node.max[0]),
                                 0.5 * (node.min[1] + node.max[1]),
                                 0.5 * (node.min[2] + node.max[2]));
    const Eigen::Vector3d half(0.5 * (node.max[0] - node.min[0]), 0.5 * (node.max[1] - node.min[1]),
                               0.5 * (node.max[2] - node.min[2]));
    for (size_t f = 0; f < facets.size() && !apart; ++f) {
      const double box_extent = facets[f].cwiseAbs().dot(half);
      apart = std::abs(facets[f].dot(centre) - facet_centre[f]) > facet_extent[f] + box_extent;
    }
    if (apart) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (touches(triangles_[i])) return true;
    }
  }
  return false;
}

}  // namespace sightline
