// SPDX-License-Identifier: Apache-2.0
#include "core/part/surface/normalise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/part/surface/sealing_faces.h"
#include "core/part/surface/vertex_welder.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Corners = std::array<Eigen::Vector3d, 3>;

constexpr double kSmallestPart_m = 1e-3, kLargestPart_m = 10;
// Sizes at the limits may come out of a difference of coordinates.
constexpr double kSizeRounding = 1e-6;
constexpr double kThinRelative = 1e-6;
// Welding moves two corners towards each other by at most 2 sqrt(3) = 3.5 tolerances.
constexpr double kThinTolerances = 4;
// Every pass after the first leaves something out; real files need two.
constexpr int kMostPasses = 8;

// Two units in the last place of the largest coordinate.
double WeldTolerance(double largest_m) {
  return std::clamp<double>(largest_m * 0x1p-22, std::numeric_limits<float>::min(),
                            kLargestMeshError_m);
}

// Largest distance between a point and its rounding to 32-bit coordinates, for coordinates up to
// `largest_m`: half a unit in the last place along each axis.
double RoundingError(double largest_m) {
  return largest_m > 0 ? std::numbers::sqrt3 * std::ldexp(1.0, std::ilogb(largest_m) - 24) : 0;
}

double ThinHeight(double longest_m, double tolerance_m) {
  return std::max(kThinRelative * longest_m, kThinTolerances * tolerance_m);
}

bool HasArea(const Corners& c, double tolerance_m) {
  const double longest_m =
      std::max({(c[1] - c[0]).norm(), (c[2] - c[1]).norm(), (c[0] - c[2]).norm()});
  const double twice_area_m2 = (c[1] - c[0]).cross(c[2] - c[0]).norm();
  return twice_area_m2 > longest_m * ThinHeight(longest_m, tolerance_m);
}

double LargestCoordinate(const Corners& c) {
  return std::max(
      {c[0].cwiseAbs().maxCoeff(), c[1].cwiseAbs().maxCoeff(), c[2].cwiseAbs().maxCoeff()});
}

// Whether corner k + 2 lies on the edge from corner k to k + 1.
std::array<bool, 3> EdgesItLiesOn(const Corners& c, double tolerance_m) {
  std::array<bool, 3> lies{};
  for (size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d edge = c[(k + 1) % 3] - c[k], to = c[(k + 2) % 3] - c[k];
    const double length2 = edge.squaredNorm();
    const double along = length2 > 0 ? std::clamp(edge.dot(to) / length2, 0.0, 1.0) : 0;
    lies[k] = (to - along * edge).norm() <= ThinHeight(std::sqrt(length2), tolerance_m);
  }
  return lies;
}

// Triangles of a file, in metres, before and between passes.
struct Faces {
  std::vector<Eigen::Vector3d> positions_m;
  std::vector<std::array<uint32_t, 3>> triangles;

  Corners Of(size_t t) const {
    const auto& v = triangles[t];
    return {positions_m[v[0]], positions_m[v[1]], positions_m[v[2]]};
  }
};

// Extent of the faces with area.
struct PartExtent {
  Eigen::AlignedBox3d box_m;
  double largest_m = 0;  // coordinate
};

absl::StatusOr<PartExtent> FindExtent(const Faces& faces, const StopCheck& stop) {
  PartExtent extent;
  for (size_t t = 0; t < faces.triangles.size(); ++t) {
    if (t % kStepsPerStopCheck == 0) {
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    }
    const Corners corners = faces.Of(t);
    const double largest_m = LargestCoordinate(corners);
    if (!(largest_m <= std::numeric_limits<float>::max())) {
      return absl::InvalidArgumentError(
          absl::StrCat("a corner of triangle ", t, " is not finite (too large)"));
    }
    // The tolerance of the whole part is known only afterwards, and at least that of each face.
    if (!HasArea(corners, WeldTolerance(largest_m))) continue;
    extent.largest_m = std::max(extent.largest_m, largest_m);
    for (const Eigen::Vector3d& corner : corners) extent.box_m.extend(corner);
  }
  // As it will be once rounded.
  extent.largest_m = static_cast<double>(static_cast<float>(extent.largest_m));
  return extent;
}

absl::Status CheckExtent(const PartExtent& extent, std::string_view unit_advice) {
  if (extent.box_m.isEmpty()) {
    return absl::InvalidArgumentError("has no triangles with area, so it has no surface");
  }
  const double size_m = extent.box_m.sizes().maxCoeff();
  if (size_m > kLargestPart_m * (1 + kSizeRounding)) {
    return absl::InvalidArgumentError(
        absl::StrCat("its largest extent is ", size_m,
                     " m, must be in [0.001, 10] m: looks like millimetres read as metres; ",
                     std::string(unit_advice)));
  }
  if (size_m < kSmallestPart_m * (1 - kSizeRounding)) {
    return absl::InvalidArgumentError(
        absl::StrCat("its largest extent is ", size_m * 1e3,
                     " mm, must be in [1, 10000] mm: looks like metres read as millimetres (or "
                     "smaller); ",
                     std::string(unit_advice)));
  }
  if (const double error_m = RoundingError(extent.largest_m); error_m > kLargestMeshError_m) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "lies %.4g m from the origin of its file: coordinates there would be rounded by up to "
        "%.3g um, at most %.3g um are allowed; move the part to the origin and export it again",
        extent.box_m.center().norm(), 1e6 * error_m, 1e6 * kLargestMeshError_m));
  }
  return absl::OkStatus();
}

struct Pass {
  TriangleMesh mesh;           // without materials
  std::vector<size_t> kept;    // index of each triangle in the faces of this pass
  bool all_have_area = false;  // then another pass would change nothing
};

// Welds faces with area, keeps thin ones that seal, and numbers vertices by first use.
absl::StatusOr<Pass> NormaliseOnce(const Faces& faces, const PartExtent& extent,
                                   const StopCheck& stop) {
  const double tolerance_m = WeldTolerance(extent.largest_m);
  const size_t count = faces.triangles.size();
  std::vector<Eigen::Vector3f> welded_m;
  VertexWelder welder(static_cast<float>(tolerance_m), &welded_m);
  std::vector<uint32_t> vertex_of(faces.positions_m.size(), VertexWelder::kNone);
  // Adding zero turns -0 into 0: the same bytes for the digest.
  const auto rounded = [&](uint32_t i) -> Eigen::Vector3f {
    return faces.positions_m[i].cast<float>() + Eigen::Vector3f::Zero();
  };
  const auto named = [&](size_t t) -> std::array<uint32_t, 3> {
    const auto& v = faces.triangles[t];
    return {vertex_of[v[0]], vertex_of[v[1]], vertex_of[v[2]]};
  };

  // Faces with area first: no other may decide where their corners are.
  std::vector<bool> has_area(count, false);
  std::vector<std::array<uint32_t, 3>> surface;
  for (size_t t = 0; t < count; ++t) {
    if (t % kStepsPerStopCheck == 0) {
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    }
    if (!HasArea(faces.Of(t), tolerance_m)) continue;
    for (const uint32_t i : faces.triangles[t]) {
      if (vertex_of[i] == VertexWelder::kNone) vertex_of[i] = welder.Add(rounded(i));
    }
    has_area[t] = true;
    surface.push_back(named(t));
  }

  // Then those of the others whose corners are there already.
  std::vector<ThinFace> thin;
  std::vector<size_t> thin_triangle;
  for (size_t t = 0; t < count; ++t) {
    if (t % kStepsPerStopCheck == 0) {
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    }
    if (has_area[t] || LargestCoordinate(faces.Of(t)) > extent.largest_m + tolerance_m) continue;
    for (const uint32_t i : faces.triangles[t]) {
      if (vertex_of[i] == VertexWelder::kNone) vertex_of[i] = welder.Find(rounded(i));
    }
    const std::array<uint32_t, 3> v = named(t);
    if (std::count(v.begin(), v.end(), VertexWelder::kNone) > 0) continue;
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    const Corners corners = {welded_m[v[0]].cast<double>(), welded_m[v[1]].cast<double>(),
                             welded_m[v[2]].cast<double>()};
    thin.push_back({v, EdgesItLiesOn(corners, tolerance_m)});
    thin_triangle.push_back(t);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const std::vector<bool> seals, SealingFaces(surface, thin, stop));
  std::vector<bool> kept = has_area;
  for (size_t i = 0; i < thin.size(); ++i) {
    if (seals[i]) kept[thin_triangle[i]] = true;
  }

  Pass pass;
  pass.all_have_area = true;
  std::vector<uint32_t> number_of(welded_m.size(), VertexWelder::kNone);
  for (size_t t = 0; t < count; ++t) {
    if (!kept[t]) continue;
    std::array<uint32_t, 3> triangle = named(t);
    Corners corners;
    for (size_t k = 0; k < 3; ++k) {
      uint32_t& number = number_of[triangle[k]];
      if (number == VertexWelder::kNone) {
        number = static_cast<uint32_t>(pass.mesh.positions_m.size());
        pass.mesh.positions_m.push_back(welded_m[triangle[k]]);
      }
      corners[k] = welded_m[triangle[k]].cast<double>();
      triangle[k] = number;
    }
    pass.all_have_area = pass.all_have_area && HasArea(corners, tolerance_m);
    pass.mesh.triangles.push_back(triangle);
    pass.kept.push_back(t);
  }
  return pass;
}

}  // namespace

absl::StatusOr<TriangleMesh> NormaliseMesh(const RawMesh& raw, double metres_per_unit,
                                           std::string_view unit_advice, const StopCheck& stop) {
  if (raw.triangles.empty()) return absl::InvalidArgumentError("has no triangles");
  Faces faces;
  faces.positions_m.reserve(raw.positions.size());
  for (size_t i = 0; i < raw.positions.size(); ++i) {
    if (!raw.positions[i].allFinite()) {
      return absl::InvalidArgumentError(
          absl::StrCat("vertex ", i, " is not finite (NaN or too large)"));
    }
    faces.positions_m.push_back(raw.positions[i] * metres_per_unit);
  }
  faces.triangles = raw.triangles;
  std::vector<size_t> origin(raw.triangles.size());  // in the file, of every triangle
  for (size_t t = 0; t < origin.size(); ++t) origin[t] = t;

  // Welding may flatten a face and thereby lower the tolerance: repeat until nothing changes.
  TriangleMesh mesh;
  for (int i = 0; i < kMostPasses; ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(const PartExtent extent, FindExtent(faces, stop));
    SIGHTLINE_RETURN_IF_ERROR(CheckExtent(extent, unit_advice));
    SIGHTLINE_ASSIGN_OR_RETURN(Pass pass, NormaliseOnce(faces, extent, stop));
    const bool same = pass.mesh.positions_m.size() == faces.positions_m.size() &&
                      pass.mesh.triangles.size() == faces.triangles.size();
    for (size_t t = 0; t < pass.kept.size(); ++t) pass.kept[t] = origin[pass.kept[t]];
    origin = std::move(pass.kept);
    mesh = std::move(pass.mesh);
    if (pass.all_have_area || (same && i > 0)) break;
    faces.triangles = mesh.triangles;
    faces.positions_m.clear();
    for (const Eigen::Vector3f& p : mesh.positions_m) faces.positions_m.push_back(p.cast<double>());
  }

  mesh.remarks = raw.remarks;
  mesh.left_out_triangles = static_cast<int64_t>(raw.triangles.size() - mesh.triangles.size());
  // A file that names no material at all has none.
  if (raw.material_names != std::vector<std::string>{""}) {
    mesh.material_names = raw.material_names;
    if (!raw.triangle_material.empty()) {
      for (const size_t t : origin) mesh.triangle_material.push_back(raw.triangle_material[t]);
    }
  }
  return mesh;
}

}  // namespace sightline
