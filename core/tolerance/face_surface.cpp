// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/face_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/part/surface_geometry.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

constexpr size_t kMaxTriangles = 5'000'000;
// Bounds the memory of the grid; more cells than triangles gain nothing.
constexpr double kMaxCells = 1 << 20;

absl::Status Wrong(int face, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat("face ", face, ": ", why));
}

absl::Status Check(const FaceTriangles& face, const FaceMatch& match) {
  if (!(match.max_distance_m > 0 && match.max_distance_m <= 0.1)) {
    return Wrong(face.face,
                 absl::StrCat("max_distance_m is ", match.max_distance_m, "; must be in (0, 0.1]"));
  }
  if (!(match.max_normal_angle_rad > 0 && match.max_normal_angle_rad <= std::numbers::pi)) {
    return Wrong(face.face, absl::StrCat("max_normal_angle_rad is ", match.max_normal_angle_rad,
                                         "; must be in (0, pi]"));
  }
  if (face.triangles.size() > kMaxTriangles) {
    return Wrong(face.face, absl::StrCat(face.triangles.size(), " triangles; at most ",
                                         kMaxTriangles, " are allowed"));
  }
  for (const Vector3d& p : face.positions_m) {
    if (!p.allFinite()) return Wrong(face.face, "a coordinate is not finite");
  }
  for (const auto& triangle : face.triangles) {
    for (const uint32_t index : triangle) {
      if (index >= face.positions_m.size()) {
        return Wrong(face.face, absl::StrCat("a triangle has index ", index, " of ",
                                             face.positions_m.size(), " positions"));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

double DistanceToTriangle(const Vector3d& point_m, const Vector3d& a_m, const Vector3d& b_m,
                          const Vector3d& c_m) {
  return (ClosestOnTriangle(point_m, a_m, b_m, c_m) - point_m).norm();
}

absl::StatusOr<FaceSurface> FaceSurface::Make(FaceTriangles face, const FaceMatch& match) {
  SIGHTLINE_RETURN_IF_ERROR(Check(face, match));
  FaceSurface surface;
  surface.match_ = match;
  surface.lower_m_.setConstant(std::numeric_limits<double>::infinity());
  surface.upper_m_ = -surface.lower_m_;
  std::vector<std::array<uint32_t, 3>> kept;
  double sum_of_sizes_m = 0;
  for (const auto& t : face.triangles) {
    const Vector3d &a = face.positions_m[t[0]], &b = face.positions_m[t[1]],
                   &c = face.positions_m[t[2]];
    const Vector3d n = (b - a).cross(c - a);
    if (!(n.norm() > 0)) continue;  // no area: neighbours cover its line
    kept.push_back(t);
    surface.normals_.push_back(n.normalized());
    surface.area_m2_ += 0.5 * n.norm();
    const Vector3d lower = a.cwiseMin(b).cwiseMin(c), upper = a.cwiseMax(b).cwiseMax(c);
    surface.lower_m_ = surface.lower_m_.cwiseMin(lower);
    surface.upper_m_ = surface.upper_m_.cwiseMax(upper);
    sum_of_sizes_m += (upper - lower).maxCoeff();
  }
  if (kept.empty()) return Wrong(face.face, "no triangle with area");
  face.triangles = std::move(kept);
  surface.face_ = std::move(face);
  const Vector3d reach = Vector3d::Constant(match.max_distance_m);
  surface.lower_m_ -= reach;
  surface.upper_m_ += reach;

  // Cells of about a triangle's size, but never so many that they outnumber what they hold.
  const std::vector<std::array<uint32_t, 3>>& triangles = surface.face_.triangles;
  const Vector3d size_m = surface.upper_m_ - surface.lower_m_;
  const double count = static_cast<double>(triangles.size());
  const double most_cells = std::min(kMaxCells, 64 + 8 * count);
  double cell_m = std::max(sum_of_sizes_m / count, 2 * match.max_distance_m);
  cell_m = std::max(cell_m, size_m.maxCoeff() / 1024);
  const auto cells_at = [&](double edge_m) {
    return std::ceil(size_m.x() / edge_m) * std::ceil(size_m.y() / edge_m) *
           std::ceil(size_m.z() / edge_m);
  };
  while (cells_at(cell_m) > most_cells) cell_m *= 1.25;
  surface.cell_m_ = cell_m;
  for (int k = 0; k < 3; ++k) {
    surface.cells_[static_cast<size_t>(k)] =
        static_cast<size_t>(std::max(1.0, std::ceil(size_m[k] / cell_m)));
  }

  // Counting sort of the triangles by the cells that their grown bounding boxes touch.
  const auto for_each_cell = [&](size_t i, auto&& visit) {
    const auto& t = triangles[i];
    const Vector3d &a = surface.face_.positions_m[t[0]], &b = surface.face_.positions_m[t[1]],
                   &c = surface.face_.positions_m[t[2]];
    std::array<size_t, 3> from, to;
    const Vector3d low = (a.cwiseMin(b).cwiseMin(c) - reach - surface.lower_m_) / cell_m;
    const Vector3d high = (a.cwiseMax(b).cwiseMax(c) + reach - surface.lower_m_) / cell_m;
    for (size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      const double last = static_cast<double>(surface.cells_[k] - 1);
      from[k] = static_cast<size_t>(std::clamp(std::floor(low[axis]), 0.0, last));
      to[k] = static_cast<size_t>(std::clamp(std::floor(high[axis]), 0.0, last));
    }
    for (size_t z = from[2]; z <= to[2]; ++z) {
      for (size_t y = from[1]; y <= to[1]; ++y) {
        for (size_t x = from[0]; x <= to[0]; ++x) {
          visit((z * surface.cells_[1] + y) * surface.cells_[0] + x);
        }
      }
    }
  };
  const size_t cell_count = surface.cells_[0] * surface.cells_[1] * surface.cells_[2];
  surface.cell_begin_.assign(cell_count + 1, 0);
  uint64_t entries = 0;
  for (size_t i = 0; i < triangles.size(); ++i) {
    for_each_cell(i, [&](size_t cell) {
      ++surface.cell_begin_[cell + 1];
      ++entries;
    });
    if (entries > (uint64_t{1} << 28)) {
      return Wrong(surface.face_.face, "its triangles are too many for its extent");
    }
  }
  for (size_t c = 0; c < cell_count; ++c) surface.cell_begin_[c + 1] += surface.cell_begin_[c];
  surface.cell_triangles_.resize(entries);
  std::vector<uint32_t> next(surface.cell_begin_.begin(), surface.cell_begin_.end() - 1);
  for (size_t i = 0; i < triangles.size(); ++i) {
    for_each_cell(
        i, [&](size_t cell) { surface.cell_triangles_[next[cell]++] = static_cast<uint32_t>(i); });
  }
  return surface;
}

size_t FaceSurface::CellOf(const Vector3d& point_m) const {
  std::array<size_t, 3> at;
  for (size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    at[k] =
        std::min(cells_[k] - 1,
                 static_cast<size_t>(std::max(0.0, (point_m[axis] - lower_m_[axis]) / cell_m_)));
  }
  return (at[2] * cells_[1] + at[1]) * cells_[0] + at[0];
}

bool FaceSurface::Contains(const Vector3d& point_m, const Vector3d& normal) const {
  // Written so that NaN is outside.
  if (!((point_m.array() >= lower_m_.array()).all() &&
        (point_m.array() <= upper_m_.array()).all())) {
    return false;
  }
  const double least_dot = std::cos(match_.max_normal_angle_rad) * normal.norm();
  const size_t cell = CellOf(point_m);
  for (uint32_t k = cell_begin_[cell]; k < cell_begin_[cell + 1]; ++k) {
    const uint32_t i = cell_triangles_[k];
    const Vector3d& n = normals_[i];
    if (!(n.dot(normal) >= least_dot)) continue;
    const auto& t = face_.triangles[i];
    const Vector3d& a = face_.positions_m[t[0]];
    if (std::abs(n.dot(point_m - a)) > match_.max_distance_m) continue;
    if (DistanceToTriangle(point_m, a, face_.positions_m[t[1]], face_.positions_m[t[2]]) <=
        match_.max_distance_m) {
      return true;
    }
  }
  return false;
}

std::vector<int> PointsOnFaces(std::span<const FaceSurface> faces,
                               std::span<const Vector3d> points_m,
                               std::span<const Vector3d> normals) {
  assert(points_m.size() == normals.size());
  std::vector<int> found;
  for (size_t i = 0; i < points_m.size(); ++i) {
    const bool on = std::any_of(faces.begin(), faces.end(), [&](const FaceSurface& face) {
      return face.Contains(points_m[i], normals[i]);
    });
    if (on) found.push_back(static_cast<int>(i));
  }
  return found;
}

}  // namespace sightline
