// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/viewer_data.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>
#include <variant>

#include "absl/strings/escaping.h"
#include "core/part/point_index.h"
#include "planner_client/report/plan/surface/uncovered_reasons.h"

namespace sightline {
namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little,
              "arrays are written as they are in memory");

template <class T>
std::string Base64(const std::vector<T>& values) {
  return absl::Base64Escape(
      absl::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)));
}

// Positions as 16-bit steps inside a cube around everything: 7 um on a 450 mm part.
struct Quantiser {
  Eigen::Vector3d origin_m;
  double quantum_m;

  void Append(const Eigen::Vector3f& position_m, std::vector<uint16_t>* out) const {
    for (int axis = 0; axis < 3; ++axis) {
      const double steps = (position_m[axis] - origin_m[axis]) / quantum_m;
      out->push_back(static_cast<uint16_t>(std::clamp(std::round(steps), 0.0, 65535.0)));
    }
  }
};

Json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json Bodies(const std::vector<Body>& bodies) {
  Json list = Json::array();
  for (const Body& body : bodies) {
    if (const auto* box = std::get_if<BoxBody>(&body)) {
      list.push_back({{"centre", Vector(box->centre_m)}, {"size", Vector(box->size_m)}});
    } else {
      const auto& cylinder = std::get<CylinderBody>(body);
      list.push_back({{"centre", Vector(cylinder.centre_m)},
                      {"radius", cylinder.radius_m},
                      {"length", cylinder.length_m}});
    }
  }
  return list;
}

Json MatrixJson(const v1::Pose& pose) {
  Json values = Json::array();
  for (const double value : pose.matrix()) values.push_back(value);
  return values;
}

// Poses x_part = M x_frame with the stage at its start, for what does not lie in part coordinates;
// null: as the part. The frame of the stage has its origin where the part's centre is, that of the
// table below it.
Json FramePose(v1::Obstacle::Frame frame, const v1::PlannedScan& scan) {
  if (frame == v1::Obstacle::FRAME_PART) return Json();
  Eigen::Matrix4d world_from_part;
  for (int i = 0; i < 16; ++i) world_from_part(i / 4, i % 4) = scan.part_pose().matrix(i);
  Eigen::Matrix4d world_from_frame = Eigen::Matrix4d::Identity();
  if (frame == v1::Obstacle::FRAME_WORLD) {
    world_from_frame(0, 3) = -scan.stage_start_m();
  } else {
    world_from_frame(1, 3) = scan.measurement().offset_y_m();
    world_from_frame(2, 3) = frame == v1::Obstacle::FRAME_TABLE ? scan.table_height_m()
                                                                : scan.measurement().offset_z_m();
  }
  const Eigen::Matrix4d pose = world_from_part.inverse() * world_from_frame;
  Json values = Json::array();
  for (int i = 0; i < 16; ++i) values.push_back(pose(i / 4, i % 4));
  return values;
}

// Larger meshes are left out: the page is to open quickly.
constexpr size_t kMaxObstacleTriangles = 200000;

Json Obstacles(const ReportData& data) {
  Json list = Json::array();
  size_t triangles = 0;
  for (const ReportObstacle& obstacle : data.obstacles) {
    triangles += obstacle.mesh->triangles.size();
    if (triangles > kMaxObstacleTriangles) break;
    std::vector<float> positions;
    for (const Eigen::Vector3f& p : obstacle.mesh->positions_m) {
      positions.insert(positions.end(), {p.x(), p.y(), p.z()});
    }
    std::vector<uint32_t> corners;
    for (const auto& triangle : obstacle.mesh->triangles) {
      corners.insert(corners.end(), triangle.begin(), triangle.end());
    }
    Json poses = Json::array();
    for (const v1::PlannedScan& scan : data.plan.scans()) {
      poses.push_back(FramePose(obstacle.frame, scan));
    }
    list.push_back({{"name", obstacle.name},
                    {"turns", obstacle.frame == v1::Obstacle::FRAME_PART},
                    {"stands_still", obstacle.frame == v1::Obstacle::FRAME_WORLD},
                    {"poses", std::move(poses)},
                    {"positions", Base64(positions)},
                    {"triangles", Base64(corners)}});
  }
  return list;
}

// Kinds of reasons, and for every target the number of its kind from 1; 0: covered.
Json Reasons(const ReportData& data) {
  std::vector<std::string> names;
  for (const ReportObstacle& obstacle : data.obstacles) names.push_back(obstacle.name);
  std::vector<uint32_t> all(data.targets.size());
  std::iota(all.begin(), all.end(), 0u);
  std::map<std::pair<int, std::string>, uint8_t> number_of;
  Json kinds = Json::array();
  for (const v1::UncoveredCount& kind :
       JoinMeasurable(CountReasons(data.reasons, data.measurable, names, all))) {
    number_of[{kind.reason(), kind.obstacle()}] = static_cast<uint8_t>(kinds.size() + 1);
    kinds.push_back({{"reason", static_cast<int>(kind.reason())},
                     {"words", ReasonWords(kind.reason(), kind.obstacle())},
                     {"targets", kind.targets()}});
  }
  std::vector<uint8_t> of_target;
  for (const TargetReason& reason : data.reasons) {
    const bool named = reason.obstacle >= 0 && static_cast<size_t>(reason.obstacle) < names.size();
    const auto kind = number_of.find(
        {reason.reason, named ? names[static_cast<size_t>(reason.obstacle)] : std::string()});
    of_target.push_back(kind == number_of.end() ? 0 : kind->second);
  }
  return {{"kinds", std::move(kinds)}, {"of_target", Base64(of_target)}};
}

// Lengths as 16-bit steps of equal ratio from 1 nm to 1 m (0.03 % each); 0: none, or zero.
constexpr double kLowestM = 1e-9, kHighestM = 1;

uint16_t LengthCode(double length_m) {
  if (!(length_m > 0)) return 0;
  const double place = std::log(length_m / kLowestM) / std::log(kHighestM / kLowestM);
  return static_cast<uint16_t>(1 + std::lround(65534 * std::clamp(place, 0.0, 1.0)));
}

template <class T>
std::string LengthCodes(const std::vector<T>& lengths_m) {
  std::vector<uint16_t> codes;
  codes.reserve(lengths_m.size());
  for (const T length_m : lengths_m) codes.push_back(LengthCode(length_m));
  return Base64(codes);
}

// Sensitivity of the measured point nearest to each target that a scan covers.
Json SensitivityOfTargets(const ScanSensitivityMap& map, const TargetSet& targets,
                          const TargetBits& covered) {
  const PointIndex<3> index(map.positions_m);
  std::vector<float> detection_m(targets.size(), 0), calibration_m(targets.size(), 0);
  for (size_t i = 0; i < targets.size(); ++i) {
    if (!covered.Test(i)) continue;
    const uint32_t nearest = index.Nearest(targets.positions_m[i]);
    detection_m[i] = map.detection_m[nearest];
    if (!map.calibration_m.empty()) calibration_m[i] = map.calibration_m[nearest];
  }
  Json json = {{"detection", LengthCodes(detection_m)}};
  if (!map.calibration_m.empty()) json["calibration"] = LengthCodes(calibration_m);
  return json;
}

Json Uncertainty(const ReportData& data) {
  const TargetUncertainties& uncertainties = *data.uncertainty;
  Json json = {{"total", LengthCodes(uncertainties.total_m)},
               {"noise", LengthCodes(uncertainties.noise_m)},
               {"sampling", LengthCodes(uncertainties.sampling_m)},
               {"calibration", LengthCodes(uncertainties.calibration_m)},
               {"admissible", LengthCodes(uncertainties.admissible_m)},
               {"relaxed_m", uncertainties.relaxed_m},
               {"lowest_m", kLowestM},
               {"highest_m", kHighestM}};
  // The page shows classes by the exact numbers, not by the steps above.
  std::vector<uint8_t> classes(data.targets.size());
  for (size_t i = 0; i < classes.size(); ++i)
    classes[i] = static_cast<uint8_t>(ClassOfTarget(uncertainties, data.measurable, i));
  json["classes"] = Base64(classes);
  json["sensitivities"] = Json::array();
  for (size_t i = 0; i < uncertainties.scan_sensitivities.size(); ++i) {
    const ScanSensitivityMap& map = uncertainties.scan_sensitivities[i];
    json["sensitivities"].push_back(
        map.positions_m.empty() ? Json()
                                : SensitivityOfTargets(map, data.targets, data.scans[i].covered));
  }
  json["features"] = Json::array();
  for (size_t f = 0; f < uncertainties.feature_targets.size(); ++f) {
    Eigen::AlignedBox3d bounds;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    const std::vector<uint32_t>& targets = uncertainties.feature_targets[f];
    for (const uint32_t target : targets) {
      bounds.extend(data.targets.positions_m[target].cast<double>());
      normal += data.targets.normals[target].cast<double>();
    }
    if (targets.empty()) {
      json["features"].push_back(Json());
      continue;
    }
    const v1::FeatureVerdict& verdict = data.plan.uncertainty().features(static_cast<int>(f));
    json["features"].push_back({{"name", verdict.name().empty() ? verdict.id() : verdict.name()},
                                {"min_m", Vector(bounds.min())},
                                {"max_m", Vector(bounds.max())},
                                {"normal", Vector(normal / static_cast<double>(targets.size()))},
                                {"targets", Base64(targets)}});
  }
  return json;
}

}  // namespace

std::string ViewerDataJson(const ReportData& data, const DisplayMesh& mesh,
                           const std::vector<UncoveredRegion>& regions) {
  Eigen::AlignedBox3d bounds = data.mesh.BoundingBox();
  for (const Eigen::Vector3f& target : data.targets.positions_m)
    bounds.extend(target.cast<double>());
  const Quantiser quantiser{bounds.min(), std::max(bounds.sizes().maxCoeff() / 65535.0, 1e-12)};

  std::vector<uint16_t> positions, target_positions, edges;
  std::vector<int16_t> normals;
  std::vector<uint32_t> triangles;
  for (const Eigen::Vector3f& p : mesh.positions_m) quantiser.Append(p, &positions);
  for (const Eigen::Vector3f& p : data.targets.positions_m) quantiser.Append(p, &target_positions);
  for (const auto& edge : mesh.feature_edges_m) {
    for (const Eigen::Vector3f& p : edge) quantiser.Append(p, &edges);
  }
  for (const Eigen::Vector3f& normal : mesh.normals) {
    for (int axis = 0; axis < 3; ++axis) {
      normals.push_back(static_cast<int16_t>(std::lround(32767.0f * normal[axis])));
    }
  }
  for (const auto& triangle : mesh.triangles)
    triangles.insert(triangles.end(), triangle.begin(), triangle.end());

  Json json;
  json["origin_m"] = Vector(quantiser.origin_m);
  json["quantum_m"] = quantiser.quantum_m;
  json["part_min_m"] = Vector(data.mesh.BoundingBox().min());
  json["part_max_m"] = Vector(data.mesh.BoundingBox().max());
  json["mesh"] = {{"positions", Base64(positions)},
                  {"normals", Base64(normals)},
                  {"triangles", Base64(triangles)},
                  {"nearest_target", Base64(mesh.nearest_target)},
                  {"edges", Base64(edges)}};
  json["targets"] = {{"count", data.targets.size()},
                     {"spacing_m", data.sampling.spacing_m},
                     {"positions", Base64(target_positions)},
                     {"measurable", absl::Base64Escape(data.measurable.ToBytes())}};
  json["rig"] = {
      {"vertical_fov_rad", data.rig.camera.vertical_fov_rad},
      {"aspect", static_cast<double>(data.rig.camera.columns_px) / data.rig.camera.rows_px},
      {"fan_angle_rad", data.rig.laser.fan_angle_rad},
      {"camera_bodies", Bodies(data.rig.camera_bodies)},
      {"laser_bodies", Bodies(data.rig.laser_bodies)}};
  if (data.robot) json["robot"] = RobotSolidsJson(*data.robot);
  json["scans"] = Json::array();
  for (int i = 0; i < data.plan.scans_size(); ++i) {
    const v1::PlannedScan& scan = data.plan.scans(i);
    // The part moves along +x of the world; seen from the part the sensors move the other way.
    const auto& part_pose = scan.part_pose().matrix();
    json["scans"].push_back({{"covered", absl::Base64Escape(data.scans[i].covered.ToBytes())},
                             {"camera_pose", MatrixJson(scan.camera_pose())},
                             {"laser_pose", MatrixJson(scan.laser_pose())},
                             {"sensor_direction", {-part_pose[0], -part_pose[1], -part_pose[2]}},
                             {"camera_distance_m", scan.measurement().camera_distance_m()},
                             {"laser_distance_m", data.rig.laser.distance_m.value_or(
                                                      scan.measurement().camera_distance_m())},
                             {"stage_start_m", scan.stage_start_m()},
                             {"stage_end_m", scan.stage_end_m()}});
    if (data.robot) json["scans"].back()["robot"] = RobotPosesJson(data.robot->scans[i]);
  }
  json["regions"] = Json::array();
  for (const UncoveredRegion& region : regions) {
    json["regions"].push_back({{"min_m", Vector(region.bounds_m.min())},
                               {"max_m", Vector(region.bounds_m.max())},
                               {"normal", Vector(region.mean_normal)},
                               {"targets", Base64(region.targets)}});
  }
  if (data.uncertainty.has_value()) json["uncertainty"] = Uncertainty(data);
  if (!data.reasons.empty()) json["reasons"] = Reasons(data);
  json["obstacles"] = Obstacles(data);
  json["regions_of_interest"] = Json::array();
  for (const TargetRegion& region : data.sampling.regions) {
    json["regions_of_interest"].push_back(
        {{"name", region.name}, {"min_m", Vector(region.min_m)}, {"max_m", Vector(region.max_m)}});
  }
  if (!data.depth_per_pixel_m.empty()) {
    json["depth_per_pixel"] = {{"codes", LengthCodes(data.depth_per_pixel_m)},
                               {"lowest_m", kLowestM},
                               {"highest_m", kHighestM}};
  }
  // Texts are checked to be UTF-8 where they are read; anything else would be an exception here.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace sightline
