// SPDX-License-Identifier: Apache-2.0
#include "core/resting/mesh_overlap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace sightline {
namespace {

constexpr int kLines = 192;  // along each of the two axes across

// Crossing of a line parallel to an axis with a surface: place along the axis, +1 where the line
// enters the body, -1 where it leaves.
struct Crossing {
  double at_m;
  int step;
};
using LineCrossings = std::vector<std::vector<Crossing>>;

// Lines of a grid over `box` through the centres of its cells.
struct LineGrid {
  int axis, across_u, across_v;
  Eigen::Vector2d low, cell;

  LineGrid(const Eigen::AlignedBox3d& box, int axis_index)
      : axis(axis_index), across_u((axis + 1) % 3), across_v((axis + 2) % 3) {
    low = {box.min()[across_u], box.min()[across_v]};
    cell = Eigen::Vector2d(box.sizes()[across_u], box.sizes()[across_v]) / kLines;
  }

  void Add(const std::array<Eigen::Vector3d, 3>& corner, LineCrossings* crossings) const {
    std::array<Eigen::Vector2d, 3> p;
    for (int k = 0; k < 3; ++k) {
      p[k] = (Eigen::Vector2d(corner[k][across_u], corner[k][across_v]) - low).cwiseQuotient(cell);
    }
    const double twice_area =
        (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
    if (twice_area == 0) return;
    const auto first = [](double a, double b, double c) {
      return std::max(0, static_cast<int>(std::ceil(std::min({a, b, c, 1e6}) - 0.5)));
    };
    const auto last = [](double a, double b, double c) {
      return std::min(kLines - 1, static_cast<int>(std::floor(std::max({a, b, c, -1e6}) - 0.5)));
    };
    const int last_u = last(p[0].x(), p[1].x(), p[2].x());
    const int last_v = last(p[0].y(), p[1].y(), p[2].y());
    for (int u = first(p[0].x(), p[1].x(), p[2].x()); u <= last_u; ++u) {
      for (int v = first(p[0].y(), p[1].y(), p[2].y()); v <= last_v; ++v) {
        const Eigen::Vector2d line(u + 0.5, v + 0.5);
        double weight[3];
        bool inside = true;
        for (int k = 0; k < 3 && inside; ++k) {
          // Seen from the lower corner, whichever triangle asks: neighbours share their edges
          // without gap or overlap.
          const Eigen::Vector2d &a = p[(k + 1) % 3], &b = p[(k + 2) % 3];
          const bool swap = std::pair(b.x(), b.y()) < std::pair(a.x(), a.y());
          const Eigen::Vector2d &from = swap ? b : a, &to = swap ? a : b;
          const double side =
              (to - from).x() * (line - from).y() - (to - from).y() * (line - from).x();
          const double oriented = (swap ? -side : side) * (twice_area > 0 ? 1 : -1);
          weight[k] = oriented / std::abs(twice_area);
          inside = oriented > 0 || (oriented == 0 && swap == (twice_area > 0));
        }
        if (!inside) continue;
        const double at_m =
            weight[0] * corner[0][axis] + weight[1] * corner[1][axis] + weight[2] * corner[2][axis];
        // Outward normals along the axis: the line leaves there.
        (*crossings)[static_cast<size_t>(u) * kLines + v].push_back(
            {at_m, twice_area > 0 ? -1 : 1});
      }
    }
  }
};

// Stretches inside the body. Where entering and leaving do not match (a body turned inside out)
// every second one counts; none where the line crosses an odd number of times.
std::vector<std::pair<double, double>> Stretches(std::vector<Crossing>& crossings) {
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return std::pair(a.at_m, -a.step) < std::pair(b.at_m, -b.step);
  });
  std::vector<std::pair<double, double>> stretches;
  int depth = 0;
  double start_m = 0;
  bool matches = true;
  for (const Crossing& crossing : crossings) {
    if (depth == 0) start_m = crossing.at_m;
    depth += crossing.step;
    matches = matches && depth >= 0;
    if (depth == 0) stretches.push_back({start_m, crossing.at_m});
  }
  if (matches && depth == 0) return stretches;
  stretches.clear();
  if (crossings.size() % 2 != 0) return stretches;
  for (size_t i = 0; i < crossings.size(); i += 2) {
    stretches.push_back({crossings[i].at_m, crossings[i + 1].at_m});
  }
  return stretches;
}

}  // namespace

MeshOverlap OverlapOf(const TriangleMesh& a, const Eigen::Isometry3d& to_b, const TriangleMesh& b) {
  MeshOverlap overlap;
  std::vector<Eigen::Vector3d> moved(a.positions_m.size());
  Eigen::AlignedBox3d box_a;
  for (size_t i = 0; i < moved.size(); ++i) {
    moved[i] = to_b * a.positions_m[i].cast<double>();
    box_a.extend(moved[i]);
  }
  const Eigen::AlignedBox3d shared = box_a.intersection(b.BoundingBox());
  if (shared.isEmpty() || !(shared.sizes().minCoeff() > 0)) return overlap;
  for (int axis = 0; axis < 3; ++axis) {
    const LineGrid grid(shared, axis);
    LineCrossings of_a(static_cast<size_t>(kLines) * kLines), of_b = of_a;
    for (const auto& t : a.triangles) grid.Add({moved[t[0]], moved[t[1]], moved[t[2]]}, &of_a);
    for (size_t t = 0; t < b.triangles.size(); ++t) {
      grid.Add({b.Corner(t, 0), b.Corner(t, 1), b.Corner(t, 2)}, &of_b);
    }
    double length_m = 0;
    for (size_t line = 0; line < of_a.size(); ++line) {
      if (of_a[line].empty() || of_b[line].empty()) continue;
      const auto in_a = Stretches(of_a[line]), in_b = Stretches(of_b[line]);
      for (size_t i = 0, k = 0; i < in_a.size() && k < in_b.size();) {
        const double both_m =
            std::min(in_a[i].second, in_b[k].second) - std::max(in_a[i].first, in_b[k].first);
        if (both_m > 0) {
          length_m += both_m;
          overlap.extent_m[axis] = std::max(overlap.extent_m[axis], both_m);
        }
        in_a[i].second < in_b[k].second ? ++i : ++k;
      }
    }
    overlap.volume_m3 += length_m * grid.cell.x() * grid.cell.y() / 3;
  }
  return overlap;
}

}  // namespace sightline
