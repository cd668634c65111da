// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/part_holding.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/field_limits/field_checks.h"
#include "core/resting/convex_hull.h"
#include "core/resting/mesh_overlap.h"
#include "core/rig/scan_geometry.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr Limits kTableSize{1e-3, 10, " m"};
constexpr Limits kTableThickness{1e-3, 1, " m"};
// Margin of the default table around the part, for every turn of the part.
constexpr double kTableMargin_m = 0.1;
// Number of turns about the vertical that are tried with obstacles if all turns are allowed.
constexpr int kTriedTurns = 12;

// Vertices stand in the order in which triangles name them, as in every mesh that was read: its
// digest is then the same on both ends of an upload.
TriangleMesh MakeBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  const Eigen::Vector3f a = low.cast<float>(), b = high.cast<float>();
  TriangleMesh box;
  box.positions_m = {{a.x(), a.y(), a.z()}, {b.x(), b.y(), a.z()}, {b.x(), a.y(), a.z()},
                     {a.x(), b.y(), a.z()}, {a.x(), a.y(), b.z()}, {b.x(), a.y(), b.z()},
                     {b.x(), b.y(), b.z()}, {a.x(), b.y(), b.z()}};
  box.triangles = {{0, 1, 2}, {0, 3, 1}, {4, 5, 6}, {4, 6, 7}, {0, 2, 5}, {0, 5, 4},
                   {3, 6, 1}, {3, 7, 6}, {0, 7, 3}, {0, 4, 7}, {2, 1, 6}, {2, 6, 5}};
  return box;
}

TriangleMesh MakeTable(const TableSize& size, const std::vector<Eigen::Vector3d>& hull_m) {
  double radius_m = 0;
  for (const Eigen::Vector3d& corner : hull_m) radius_m = std::max(radius_m, corner.norm());
  const double all_around_m = 2 * (radius_m + kTableMargin_m);
  const double x = 0.5 * size.size_x_m.value_or(all_around_m);
  const double y = 0.5 * size.size_y_m.value_or(all_around_m);
  return MakeBox({-x, -y, -size.thickness_m}, {x, y, 0});
}

std::vector<double> TriedTurns(const ParameterDomain& gamma) {
  if (!gamma.values.empty()) {
    return {gamma.values.begin(),
            gamma.values.begin() + std::min<std::ptrdiff_t>(std::ssize(gamma.values), kTriedTurns)};
  }
  double total = 0;
  for (const auto& range : gamma.ranges) total += range.max - range.min;
  std::vector<double> turns;
  for (const auto& range : gamma.ranges) {
    const int count =
        std::max(1, static_cast<int>(std::lround(kTriedTurns * (range.max - range.min) /
                                                 std::max(total, 1e-9))));
    for (int i = 0; i < count; ++i) {
      turns.push_back(range.min + (range.max - range.min) * i / count);
    }
  }
  return turns;
}

// Least stability of offered faces by the current defaults.
constexpr double kLeastStability_rad = 15 * std::numbers::pi / 180;

// Moves the faces that topple too easily to `excluded`. Faces come by falling stability.
void ExcludeUnstable(HeldPart* held) {
  const auto unstable = std::find_if(
      held->faces.begin(), held->faces.end(),
      [](const RestingFace& face) { return face.stability_rad < kLeastStability_rad; });
  for (auto face = unstable; face != held->faces.end(); ++face) {
    held->excluded.push_back({*face,
                              absl::StrFormat("it topples at %.0f deg, less than %.0f deg",
                                              face->stability_rad * 180 / std::numbers::pi,
                                              kLeastStability_rad * 180 / std::numbers::pi),
                              ""});
  }
  held->faces.erase(unstable, held->faces.end());
}

// Depth of an obstacle in the part's frame below the table's upper face [m]; <= 0: it does not
// reach into the table.
double DepthInTable(const TriangleMesh& obstacle, const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& centre_m, double table_height_m, double table_reach_m) {
  double depth_m = 0;
  for (const Eigen::Vector3f& vertex : obstacle.positions_m) {
    const Eigen::Vector3d x = rotation * (vertex.cast<double>() - centre_m);
    if (x.head<2>().norm() > table_reach_m) continue;
    depth_m = std::max(depth_m, table_height_m - x.z());
  }
  return depth_m;
}

void LimitOffsets(const TriangleMesh& part, Inspection* inspection) {
  const LargestOffset largest = LargestOffsetOf(part.BoundingBox().sizes().norm());
  const auto limit = [&](MeasurementParameter parameter, bool given, double largest_m) {
    if (!given) inspection->domain.parameters[parameter].ranges = {{-largest_m, largest_m}};
  };
  limit(kOffsetY, inspection->offset_y_given, largest.y_m);
  limit(kOffsetZ, inspection->offset_z_given, largest.z_m);
}

bool Cuts(const MeshOverlap& overlap) { return overlap.depth_m() > kToleratedDepth_m; }

std::string Describe(const MeshOverlap& overlap) {
  return absl::StrFormat("cuts into the part: %.3g cm3 of it, %.1f mm deep",
                         1e6 * overlap.volume_m3, 1e3 * overlap.depth_m());
}

}  // namespace

std::optional<ObstacleFrame> ObstacleFrameFromProto(v1::Obstacle::Frame frame) {
  switch (frame) {
    case v1::Obstacle::FRAME_PART:
      return ObstacleFrame::kPart;
    case v1::Obstacle::FRAME_STAGE:
      return ObstacleFrame::kStage;
    case v1::Obstacle::FRAME_WORLD:
      return ObstacleFrame::kWorld;
    case v1::Obstacle::FRAME_TABLE:
      return ObstacleFrame::kTable;
    default:
      return std::nullopt;
  }
}

v1::Obstacle::Frame ObstacleFrameToProto(ObstacleFrame frame) {
  switch (frame) {
    case ObstacleFrame::kPart:
      return v1::Obstacle::FRAME_PART;
    case ObstacleFrame::kStage:
      return v1::Obstacle::FRAME_STAGE;
    case ObstacleFrame::kWorld:
      return v1::Obstacle::FRAME_WORLD;
    case ObstacleFrame::kTable:
      return v1::Obstacle::FRAME_TABLE;
  }
  return v1::Obstacle::FRAME_UNSPECIFIED;
}

absl::Status ParsePartHolding(const v1::Inspection& message, const std::string& context,
                              Inspection* inspection) {
  const Checker check(context);
  const v1::MeasurementDomain& domain = message.measurement();
  const char* own_domain = domain.has_part_alpha_deg()  ? "measurement.part_alpha_deg"
                           : domain.has_part_beta_deg() ? "measurement.part_beta_deg"
                                                        : nullptr;
  switch (message.rig().part_holding()) {
    case v1::Rig::PART_HOLDING_UNSPECIFIED:
      inspection->part_holding = own_domain ? PartHolding::kFree : PartHolding::kResting;
      break;
    case v1::Rig::PART_HOLDING_RESTING:
      inspection->part_holding = PartHolding::kResting;
      if (own_domain) {
        return check.Error(
            own_domain,
            "cannot be given with rig.part_holding PART_HOLDING_RESTING: a part that "
            "rests lies on its faces or in measurement.resting_orientations");
      }
      break;
    case v1::Rig::PART_HOLDING_FIXTURE:
      inspection->part_holding = PartHolding::kFixture;
      if (own_domain || domain.resting_orientations_size() > 0) {
        return check.Error(own_domain ? own_domain : "measurement.resting_orientations",
                           "cannot be given with rig.part_holding PART_HOLDING_FIXTURE, which "
                           "holds the part as the CAD file has it");
      }
      inspection->domain.parameters[kPartAlpha] = {.ranges = {}, .values = {0}, .periodic = true};
      inspection->domain.parameters[kPartBeta] = {.ranges = {}, .values = {0}, .periodic = true};
      break;
    case v1::Rig::PART_HOLDING_FREE:
      inspection->part_holding = PartHolding::kFree;
      break;
    default:
      return check.Error("rig.part_holding", "is unknown");
  }
  if (!message.rig().has_table()) return absl::OkStatus();
  const v1::Table& table = message.rig().table();
  if (inspection->part_holding != PartHolding::kResting) {
    return check.Error("rig.table",
                       "is for parts that rest on it: rig.part_holding must be "
                       "PART_HOLDING_RESTING");
  }
  if (table.has_size_x_m()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("rig.table.size_x_m", table.size_x_m(), kTableSize));
    inspection->table.size_x_m = table.size_x_m();
  }
  if (table.has_size_y_m()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("rig.table.size_y_m", table.size_y_m(), kTableSize));
    inspection->table.size_y_m = table.size_y_m();
  }
  if (table.has_thickness_m()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("rig.table.thickness_m", table.thickness_m(), kTableThickness));
    inspection->table.thickness_m = table.thickness_m();
  }
  return absl::OkStatus();
}

absl::StatusOr<HeldPart> HoldPart(const TriangleMesh& part, Inspection* inspection) {
  HeldPart held;
  LimitOffsets(part, inspection);
  const bool rests = inspection->part_holding == PartHolding::kResting;
  const bool on_table =
      rests || std::any_of(inspection->obstacles.begin(), inspection->obstacles.end(),
                           [](const auto& o) { return o.frame == ObstacleFrame::kTable; });
  if (!on_table) return held;
  const auto hull = MakeConvexHull(part.positions_m);
  if (!hull.ok()) {
    return absl::Status(hull.status().code(),
                        absl::StrCat(inspection->part_file, ": ", hull.status().message(),
                                     "; such a part needs rig.part_holding PART_HOLDING_FIXTURE or "
                                     "PART_HOLDING_FREE"));
  }
  const Eigen::Vector3d centre = part.BoundingBox().center();
  std::vector<Eigen::Vector3d> corners = hull->corners_m;
  for (Eigen::Vector3d& corner : corners) corner -= centre;
  if (rests) {
    held.table = MakeTable(inspection->table, corners);
    const Eigen::Vector3d mass_centre = MassCentre(part, *hull);
    std::vector<RestingOrientation>& orientations = inspection->domain.resting_orientations;
    if (orientations.empty()) {
      held.faces = FindRestingFaces(*hull, mass_centre);
      if (held.faces.empty()) {
        return absl::InvalidArgumentError(
            absl::StrCat(inspection->part_file,
                         ": the part stands on none of its faces by itself; give "
                         "measurement.resting_orientations (on a support that is an obstacle), or "
                         "rig.part_holding PART_HOLDING_FIXTURE or PART_HOLDING_FREE"));
      }
      if (inspection->defaults != DefaultsVersion::k0_1) ExcludeUnstable(&held);
      if (held.faces.empty()) {
        return absl::InvalidArgumentError(absl::StrFormat(
            "%s: the part topples from each of its faces: from the most stable one, %s, at %.0f "
            "deg, "
            "less than %.0f deg; give measurement.resting_orientations (with a fixture that is an "
            "obstacle), rig.part_holding PART_HOLDING_FIXTURE, or \"defaults\": \"0.1\", which "
            "takes faces from 3 deg on",
            inspection->part_file, held.excluded.front().face.name,
            held.excluded.front().face.stability_rad * 180 / std::numbers::pi,
            kLeastStability_rad * 180 / std::numbers::pi));
      }
      for (const RestingFace& face : held.faces) {
        orientations.push_back({face.part_alpha_rad, face.part_beta_rad, face.name});
      }
    } else {
      std::set<std::string> names;
      for (const RestingOrientation& given : orientations) names.insert(given.name);
      for (size_t i = 0; i < orientations.size(); ++i) {
        RestingOrientation& given = orientations[i];
        for (size_t k = i; given.name.empty(); ++k) {
          std::string name =
              k < 26 ? std::string(1, static_cast<char>('A' + k)) : absl::StrCat("face ", k + 1);
          if (names.insert(name).second) given.name = std::move(name);
        }
        held.faces.push_back(
            DescribeRest(*hull, mass_centre, given.part_alpha_rad, given.part_beta_rad));
        held.faces.back().name = given.name;
      }
    }
  }
  inspection->rig.part_support_points_m =
      std::make_shared<const std::vector<Eigen::Vector3d>>(std::move(corners));
  return held;
}

absl::Status CheckObstaclesClear(const TriangleMesh& part, const Inspection& inspection,
                                 const HeldPart& held,
                                 const std::vector<PlacedObstacle>& obstacles) {
  const Eigen::Vector3d centre = part.BoundingBox().center();
  std::vector<RestingOrientation> orientations = inspection.domain.resting_orientations;
  if (inspection.part_holding == PartHolding::kFixture) orientations = {{0, 0}};
  const std::vector<double> turns = TriedTurns(inspection.domain.parameters[kPartGamma]);
  for (size_t i = 0; i < obstacles.size(); ++i) {
    const PlacedObstacle& obstacle = obstacles[i];
    const auto error = [&](const std::string& what) {
      return absl::InvalidArgumentError(
          absl::StrCat("obstacles[", i, "] \"", obstacle.name, "\" ", what));
    };
    if (obstacle.frame == ObstacleFrame::kPart) {
      const MeshOverlap overlap = OverlapOf(part, Eigen::Isometry3d::Identity(), *obstacle.mesh);
      if (Cuts(overlap)) return error(Describe(overlap));
      continue;
    }
    if (obstacle.frame == ObstacleFrame::kWorld) continue;
    for (size_t o = 0; o < orientations.size(); ++o) {
      MeshOverlap least;
      bool cuts = !turns.empty();
      for (const double turn : turns) {
        Measurement m;
        m.part_alpha_rad = orientations[o].part_alpha_rad;
        m.part_beta_rad = orientations[o].part_beta_rad;
        m.part_gamma_rad = turn;
        const ScanGeometry g = MakeScanGeometry(inspection.rig, m);
        Eigen::Isometry3d to_obstacle = Eigen::Isometry3d::Identity();
        to_obstacle.linear() = g.part_rotation;
        to_obstacle.translation() = -(g.part_rotation * centre);
        if (obstacle.frame == ObstacleFrame::kTable) {
          to_obstacle.translation().z() -= g.table_height_m;
        }
        const MeshOverlap overlap = OverlapOf(part, to_obstacle, *obstacle.mesh);
        if (!Cuts(overlap)) {
          cuts = false;
          break;
        }
        if (least.volume_m3 == 0 || overlap.volume_m3 < least.volume_m3) least = overlap;
      }
      if (!cuts) continue;
      const std::string where =
          o < held.faces.size() ? absl::StrCat(" when it lies on face ", held.faces[o].name) : "";
      return error(absl::StrCat(Describe(least), where,
                                turns.size() > 1 ? ", however it is turned about the vertical" : "",
                                obstacle.frame == ObstacleFrame::kStage
                                    ? "; z = 0 of FRAME_STAGE is the centre of the part's bounding "
                                      "box, of FRAME_TABLE what the part lies on"
                                    : ""));
    }
  }
  return absl::OkStatus();
}

absl::Status ExcludeBlockedRests(const TriangleMesh& part,
                                 const std::vector<PlacedObstacle>& obstacles,
                                 Inspection* inspection, HeldPart* held) {
  if (inspection->defaults == DefaultsVersion::k0_1 || !held->table) return absl::OkStatus();
  const Eigen::Vector3d centre_m = part.BoundingBox().center();
  const Eigen::AlignedBox3d table = held->table->BoundingBox();
  const double table_reach_m = 0.5 * table.sizes().head<2>().norm();
  std::vector<RestingOrientation>& orientations = inspection->domain.resting_orientations;
  for (size_t i = 0; i < held->faces.size();) {
    Measurement rest;
    rest.part_alpha_rad = orientations[i].part_alpha_rad;
    rest.part_beta_rad = orientations[i].part_beta_rad;
    const ScanGeometry geometry = MakeScanGeometry(inspection->rig, rest);
    double deepest_m = kToleratedDepth_m;
    const PlacedObstacle* blocking = nullptr;
    for (const PlacedObstacle& obstacle : obstacles) {
      if (obstacle.frame != ObstacleFrame::kPart) continue;
      const double depth_m = DepthInTable(*obstacle.mesh, geometry.part_rotation, centre_m,
                                          geometry.table_height_m, table_reach_m);
      if (depth_m <= deepest_m) continue;
      deepest_m = depth_m;
      blocking = &obstacle;
    }
    if (blocking == nullptr) {
      ++i;
      continue;
    }
    held->excluded.push_back({held->faces[i],
                              absl::StrFormat("\"%s\" would stand %.0f mm in the table",
                                              blocking->name, 1e3 * deepest_m),
                              blocking->name});
    held->faces.erase(held->faces.begin() + static_cast<std::ptrdiff_t>(i));
    orientations.erase(orientations.begin() + static_cast<std::ptrdiff_t>(i));
  }
  if (!held->faces.empty()) return absl::OkStatus();
  std::string reasons;
  for (const ExcludedRest& excluded : held->excluded) {
    absl::StrAppend(&reasons, reasons.empty() ? "" : "; ", "face ", excluded.face.name, ": ",
                    excluded.because);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the part cannot lie on any of its faces: ", reasons,
                   "; give rig.part_holding PART_HOLDING_FIXTURE if the obstacle holds it"));
}

}  // namespace sightline
