// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/artefact_scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sightline {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kFieldSamples = 2500;

bool FacesBoth(const TriangulationSetup& setup, const ArtefactSurface& surface,
               const Vector3d& point_m, const SightLimits& limits) {
  return IsSeen(surface, point_m, setup.camera.origin_m, limits.most_incidence_rad) &&
         IsSeen(surface, point_m, setup.laser.origin_m, limits.most_incidence_rad);
}

bool InFan(const Rig& rig, const TriangulationSetup& setup, const Vector3d& point_m) {
  const Vector3d ray = point_m - setup.laser.origin_m;
  const double along = setup.laser.z_axis.dot(ray);
  return along > 0 &&
         std::abs(setup.laser.x_axis.dot(ray)) <= along * std::tan(0.5 * rig.laser.fan_angle_rad);
}

bool InImage(const Rig& rig, const TriangulationSetup& setup, const Vector3d& point_m) {
  if (!(setup.camera.z_axis.dot(point_m - setup.camera.origin_m) > 0)) return false;
  const Vector2d px = ProjectPoint(setup, point_m);
  return px.x() >= 0 && px.x() <= rig.camera.columns_px - 1 && px.y() >= 0 &&
         px.y() <= rig.camera.rows_px - 1;
}

bool InRange(const TriangulationSetup& setup, const Vector3d& point_m, const SightLimits& limits) {
  return (point_m - setup.camera.origin_m).norm() <= limits.max_range_m;
}

struct StageRange {
  double lowest_m = std::numeric_limits<double>::infinity();
  double highest_m = -std::numeric_limits<double>::infinity();
};

// Positions of the stage at which places of the surface are lit that face camera and laser.
StageRange LitRange(const Rig& rig, const ScanGeometry& geometry, const ArtefactSurface& surface,
                    const SightLimits& limits) {
  StageRange range;
  for (const Vector3d& point_m : SamplePoints(surface, kFieldSamples)) {
    const double stage_m = geometry.LitStagePosition(point_m);
    if (!std::isfinite(stage_m)) continue;
    if (!FacesBoth(SetupAt(rig, geometry, stage_m), surface, point_m, limits)) continue;
    range.lowest_m = std::min(range.lowest_m, stage_m);
    range.highest_m = std::max(range.highest_m, stage_m);
  }
  return range;
}

// The point nearest to the camera in which the column's plane, the sheet and the surface meet.
std::optional<ArtefactPoint> PointOf(const Rig& rig, const TriangulationSetup& setup,
                                     const ArtefactSurface& surface, int column_px,
                                     const SightLimits& limits) {
  const Vector3d a = Triangulate(setup, Vector2d(column_px, 0.3 * rig.camera.rows_px));
  const Vector3d b = Triangulate(setup, Vector2d(column_px, 0.7 * rig.camera.rows_px));
  if (!a.allFinite() || !b.allFinite()) return std::nullopt;
  std::optional<ArtefactPoint> nearest;
  for (const Vector3d& crossing : Crossings(surface, a, b - a)) {
    const double distance_m = (crossing - setup.camera.origin_m).norm();
    if (nearest && distance_m > nearest->distance_m) continue;
    if (!FacesBoth(setup, surface, crossing, limits) || !InImage(rig, setup, crossing) ||
        !InFan(rig, setup, crossing) || !InRange(setup, crossing, limits)) {
      continue;
    }
    ArtefactPoint p;
    p.column_px = column_px;
    p.row_px = ProjectPoint(setup, crossing).y();
    p.position_m = crossing;
    p.normal = DistanceGradient(surface.nominal, crossing, Vector3d::UnitZ());
    p.distance_m = distance_m;
    const Vector3d to_camera = (setup.camera.origin_m - crossing) / distance_m;
    p.incidence_rad = std::acos(std::clamp(AirNormal(surface, crossing).dot(to_camera), -1.0, 1.0));
    const Vector3d ray = crossing - setup.camera.origin_m;
    p.slope_m_per_px = ImageDerivativesAlong(p.normal, setup.camera, setup.focal_length_px,
                                             setup.laser.y_axis, ray, setup.camera.z_axis.dot(ray))
                           .y();
    nearest = p;
  }
  return nearest;
}

}  // namespace

TriangulationSetup SetupAt(const Rig& rig, const ScanGeometry& geometry, double stage_m) {
  const Vector3d centre = Vector3d::Zero();
  ScanGeometry unturned = geometry;
  unturned.part_rotation.setIdentity();
  unturned.part_offset_m.setZero();
  return MakeTriangulationSetup(rig.camera, WorldToPart(unturned, centre, geometry.camera, stage_m),
                                WorldToPart(unturned, centre, geometry.laser, stage_m));
}

absl::Status FitsIntoField(const Rig& rig, const ScanGeometry& geometry, const Artefact& artefact,
                           const SightLimits& limits) {
  int facing = 0, outside_image = 0, outside_fan = 0, outside_range = 0;
  StageRange travel;
  for (const ArtefactSurface& surface : artefact.surfaces) {
    const StageRange range = LitRange(rig, geometry, surface, limits);
    travel.lowest_m = std::min(travel.lowest_m, range.lowest_m);
    travel.highest_m = std::max(travel.highest_m, range.highest_m);
    for (const Vector3d& point_m : SamplePoints(surface, kFieldSamples)) {
      const double stage_m = geometry.LitStagePosition(point_m);
      if (!std::isfinite(stage_m)) continue;
      const TriangulationSetup setup = SetupAt(rig, geometry, stage_m);
      if (!FacesBoth(setup, surface, point_m, limits)) continue;
      ++facing;
      if (!InImage(rig, setup, point_m)) ++outside_image;
      if (!InFan(rig, setup, point_m)) ++outside_fan;
      if (!InRange(setup, point_m, limits)) ++outside_range;
    }
  }
  if (facing == 0) {
    return absl::OutOfRangeError("no place of it faces both camera and laser");
  }
  const auto outside = [&](int count, const char* what) {
    return absl::OutOfRangeError(absl::StrFormat(
        "%.0f %% of what faces camera and laser is outside the %s", 100.0 * count / facing, what));
  };
  if (outside_image > 0) return outside(outside_image, "camera's field of view");
  if (outside_fan > 0) return outside(outside_fan, "laser's fan");
  if (outside_range > 0) {
    return outside(outside_range, absl::StrFormat("range of %.3g m", limits.max_range_m).c_str());
  }
  if (travel.highest_m - travel.lowest_m > rig.stage_travel_m) {
    return absl::OutOfRangeError(absl::StrFormat("it takes %.3g m of travel, the stage has %.3g m",
                                                 travel.highest_m - travel.lowest_m,
                                                 rig.stage_travel_m));
  }
  return absl::OkStatus();
}

ArtefactScan ScanArtefact(const Rig& rig, const ScanGeometry& geometry, const Artefact& artefact,
                          const SightLimits& limits) {
  ArtefactScan scan;
  for (size_t s = 0; s < artefact.surfaces.size(); ++s) {
    const ArtefactSurface& surface = artefact.surfaces[s];
    const StageRange range = LitRange(rig, geometry, surface, limits);
    if (!(range.highest_m > range.lowest_m)) continue;
    const size_t first = scan.points.size();
    const int last_frame = static_cast<int>(std::floor(range.highest_m / rig.scan_step_m));
    for (int k = static_cast<int>(std::ceil(range.lowest_m / rig.scan_step_m)); k <= last_frame;
         ++k) {
      const double stage_m = k * rig.scan_step_m;
      const TriangulationSetup setup = SetupAt(rig, geometry, stage_m);
      const auto frame = static_cast<int>(scan.frames.size());
      bool any = false;
      for (int column = 0; column < rig.camera.columns_px; ++column) {
        std::optional<ArtefactPoint> p = PointOf(rig, setup, surface, column, limits);
        if (!p) continue;
        p->surface = static_cast<int>(s);
        p->frame = frame;
        scan.points.push_back(*p);
        any = true;
      }
      if (any) scan.frames.push_back({stage_m, setup});
    }
    const auto stride =
        static_cast<int>((scan.points.size() - first) / static_cast<size_t>(limits.most_points)) +
        1;
    const auto left_out = [&](const ArtefactPoint& p) { return p.column_px % stride != 0; };
    scan.points.erase(std::remove_if(scan.points.begin() + static_cast<std::ptrdiff_t>(first),
                                     scan.points.end(), left_out),
                      scan.points.end());
  }
  return scan;
}

void ThinColumns(int most_points, ArtefactScan* scan) {
  std::map<int, std::map<int, int>> columns;  // points by surface and column
  for (const ArtefactPoint& p : scan->points) ++columns[p.surface][p.column_px];
  std::set<std::pair<int, int>> kept;
  for (const auto& [surface, counts] : columns) {
    int points = 0;
    for (const auto& [column, count] : counts) points += count;
    const int stride = (points + most_points - 1) / most_points;
    int rank = 0;
    for (const auto& [column, count] : counts) {
      if (rank++ % stride == 0) kept.emplace(surface, column);
    }
  }
  std::erase_if(scan->points, [&](const ArtefactPoint& p) {
    return !kept.contains({p.surface, p.column_px});
  });
}

}  // namespace sightline
