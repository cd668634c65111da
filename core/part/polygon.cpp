// SPDX-License-Identifier: Apache-2.0
#include "core/part/polygon.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using PlanePoint = std::array<double, 2>;

// Twice the signed area of the triangle a-b-c; positive: counter-clockwise.
double Turn(const PlanePoint& a, const PlanePoint& b, const PlanePoint& c) {
  return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
}

// Corners of a polygon by their places, in cells of a grid over its bounding box.
class CornerGrid {
 public:
  CornerGrid(std::span<const PlanePoint> places, const std::vector<uint32_t>& corners)
      : low_(places[0]) {
    PlanePoint high = low_;
    for (const PlanePoint& place : places) {
      for (int k = 0; k < 2; ++k) {
        low_[k] = std::min(low_[k], place[k]);
        high[k] = std::max(high[k], place[k]);
      }
    }
    // About one corner a cell.
    const double width = high[0] - low_[0], height = high[1] - low_[1];
    const double count = static_cast<double>(std::max<size_t>(1, corners.size()));
    const double side = std::sqrt(width * height / count);
    for (int k = 0; k < 2; ++k) {
      const double extent = k == 0 ? width : height;
      const double cells = side > 0 ? extent / side : extent > 0 ? count : 1;
      // Not for a long thin polygon alone more cells than corners.
      cells_[k] = static_cast<int>(std::clamp(cells, 1.0, std::max(1.0, count)));
      scale_[k] = extent > 0 ? cells_[k] / extent : 0;
    }
    // Corners by cell, as a list of lists in one array.
    const size_t total = static_cast<size_t>(cells_[0]) * static_cast<size_t>(cells_[1]);
    begin_.assign(total + 1, 0);
    for (const uint32_t corner : corners) ++begin_[Cell(places[corner]) + 1];
    for (size_t cell = 0; cell < total; ++cell) begin_[cell + 1] += begin_[cell];
    end_.assign(begin_.begin(), begin_.end() - 1);
    corners_.resize(corners.size());
    for (const uint32_t corner : corners) corners_[end_[Cell(places[corner])]++] = corner;
  }

  // Whether `blocks` holds for any corner in the cells about the triangle. Those for which `gone`
  // holds are forgotten. Counts the steps of work.
  template <typename Gone, typename Blocks>
  bool Any(const PlanePoint& a, const PlanePoint& b, const PlanePoint& c, const Gone& gone,
           const Blocks& blocks, int64_t* steps) {
    int first[2], last[2];
    for (int k = 0; k < 2; ++k) {
      first[k] = Index(k, std::min({a[k], b[k], c[k]}));
      last[k] = Index(k, std::max({a[k], b[k], c[k]}));
    }
    for (int row = first[1]; row <= last[1]; ++row) {
      for (int column = first[0]; column <= last[0]; ++column) {
        const size_t cell = static_cast<size_t>(row) * cells_[0] + column;
        ++*steps;
        for (uint32_t i = begin_[cell]; i < end_[cell];) {
          ++*steps;
          const uint32_t corner = corners_[i];
          if (gone(corner)) {
            corners_[i] = corners_[--end_[cell]];
            continue;
          }
          if (blocks(corner)) return true;
          ++i;
        }
      }
    }
    return false;
  }

 private:
  int Index(int axis, double value) const {
    // Also of extents that overflow: some cell.
    const double cell = (value - low_[axis]) * scale_[axis];
    if (!(cell > 0)) return 0;
    return cell < cells_[axis] - 1 ? static_cast<int>(cell) : cells_[axis] - 1;
  }
  size_t Cell(const PlanePoint& place) const {
    return static_cast<size_t>(Index(1, place[1])) * cells_[0] + Index(0, place[0]);
  }

  PlanePoint low_;
  int cells_[2];
  double scale_[2];
  std::vector<uint32_t> begin_, end_, corners_;
};

void Fan(std::span<const uint32_t> corners, RawMesh* mesh) {
  for (size_t i = 1; i + 1 < corners.size(); ++i) {
    mesh->triangles.push_back({corners[0], corners[i], corners[i + 1]});
  }
}

}  // namespace

absl::Status PolygonCutter::Add(std::span<const uint32_t> corners, RawMesh* mesh) {
  const auto& p = mesh->positions;
  const size_t n = corners.size();
  // Both before anything is allocated for the corners.
  if (n > kMostCorners) {
    return absl::InvalidArgumentError(absl::StrCat("a face has ", n, " corners, at most ",
                                                   kMostCorners, " can be cut into triangles"));
  }
  if (n > 2 && n - 2 > kMaxTriangles - std::min(kMaxTriangles, mesh->triangles.size())) {
    return absl::InvalidArgumentError(
        absl::StrCat("too many triangles, at most ", kMaxTriangles, " can be read"));
  }
  if (n <= 3) {
    Fan(corners, mesh);
    return absl::OkStatus();
  }
  // Newell's normal: right for concave polygons too.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < n; ++i) {
    normal += (p[corners[i]] - p[corners[0]]).cross(p[corners[(i + 1) % n]] - p[corners[0]]);
  }
  // Seen along the axis nearest to the normal: shape and order stay, coordinates stay exact.
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  int u = (axis + 1) % 3, v = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(u, v);
  std::vector<PlanePoint> places(n);
  bool finite = true;
  for (size_t i = 0; i < n; ++i) {
    places[i] = {p[corners[i]][u], p[corners[i]][v]};
    finite = finite && p[corners[i]].allFinite();
  }
  bool convex = true;
  for (size_t i = 0; i < n && convex; ++i) {
    convex = Turn(places[(i + n - 1) % n], places[i], places[(i + 1) % n]) >= 0;
  }
  // A later check rejects coordinates that are not finite and names them.
  if (convex || !finite || !normal.allFinite() || normal.isZero(0)) {
    Fan(corners, mesh);
    return absl::OkStatus();
  }
  return CutEars(corners, places, mesh);
}

absl::Status PolygonCutter::CutEars(std::span<const uint32_t> corners,
                                    std::span<const PlanePoint> places, RawMesh* mesh) {
  const uint32_t n = static_cast<uint32_t>(corners.size());
  std::vector<uint32_t> next(n), previous(n);
  for (uint32_t i = 0; i < n; ++i) {
    next[i] = (i + 1) % n;
    previous[i] = (i + n - 1) % n;
  }
  const auto turn_at = [&](uint32_t i) {
    return Turn(places[previous[i]], places[i], places[next[i]]);
  };
  // Only a corner that does not turn outwards can lie in an ear, and cutting ears makes none.
  std::vector<uint32_t> inward;
  std::vector<bool> may_block(n, false);
  for (uint32_t i = 0; i < n; ++i) {
    if (turn_at(i) > 0) continue;
    may_block[i] = true;
    inward.push_back(i);
  }
  CornerGrid grid(places, inward);

  int64_t steps = n;
  int64_t next_stop_check = 1 << 20;
  const auto spend = [&]() -> absl::Status {
    if (n > kFewCorners && steps_ + steps > kMostSteps) {
      return absl::InvalidArgumentError(absl::StrCat(
          "a face of ", n,
          " corners, or all such faces together, take too long to cut into triangles: export the "
          "part as triangles"));
    }
    if (steps < next_stop_check) return absl::OkStatus();
    next_stop_check = steps + (1 << 20);
    return CheckStop(stop_);
  };

  uint32_t left = n, at = 0, tried_in_vain = 0;
  while (left > 3 && tried_in_vain < left) {
    const uint32_t a = previous[at], c = next[at];
    const PlanePoint &pa = places[a], &pb = places[at], &pc = places[c];
    ++steps;
    bool ear = Turn(pa, pb, pc) > 0;
    if (ear) {
      const auto gone = [&](uint32_t q) { return !may_block[q]; };
      const auto inside = [&](uint32_t q) {
        // A bridge between a hole and the outline puts two corners at one place.
        const PlanePoint& pq = places[q];
        if (pq == pa || pq == pb || pq == pc) return false;
        return Turn(pa, pb, pq) >= 0 && Turn(pb, pc, pq) >= 0 && Turn(pc, pa, pq) >= 0;
      };
      ear = !grid.Any(pa, pb, pc, gone, inside, &steps);
    }
    SIGHTLINE_RETURN_IF_ERROR(spend());
    if (!ear) {
      at = c;
      ++tried_in_vain;
      continue;
    }
    mesh->triangles.push_back({corners[a], corners[at], corners[c]});
    may_block[at] = false;
    next[a] = c;
    previous[c] = a;
    --left;
    for (const uint32_t i : {a, c}) may_block[i] = may_block[i] && turn_at(i) <= 0;
    // Going on behind the next corner makes fewer slivers than cutting at one place.
    at = next[c];
    tried_in_vain = 0;
  }
  if (n > kFewCorners) steps_ += steps;
  std::vector<uint32_t> rest;
  for (uint32_t i = 0; i < left; ++i, at = next[at]) rest.push_back(corners[at]);
  Fan(rest, mesh);
  return absl::OkStatus();
}

}  // namespace sightline
