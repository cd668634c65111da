// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/inspection.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/field_limits/field_checks.h"
#include "core/field_limits/target_limits.h"
#include "core/inspection/imaging.h"
#include "core/inspection/part_holding.h"
#include "core/inspection/read_with_files.h"
#include "core/inspection/vector_proto.h"
#include "core/json/error_list.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/status/status_macros.h"
#include "core/text/length_unit.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr double kLargest = 1e9;  // stands for "no upper limit" where only the sign matters

// --- rig, camera, lens, laser -------------------------------------------------------------------

constexpr Limits kScanStep{1e-5, 0.1, " m"};
constexpr Limits kStageTravel{0, 20, " m", true};
constexpr Limits kMaxRange{0, 100, " m", true};
constexpr Limits kClearance{0, 1, " m"};
constexpr double kDefaultClearance_m = 0.005;
constexpr Limits kBodyLength{0, 10, " m", true};
constexpr Limits kBodyCentre{-10, 10, " m"};

absl::Status CheckVector(const Checker& check, const std::string& path, const v1::Vector3& v,
                         const Limits& limits) {
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".x", v.x(), limits));
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".y", v.y(), limits));
  return check.Range(path + ".z", v.z(), limits);
}

absl::StatusOr<Body> ParseBody(const v1::Body& message, const std::string& path,
                               const Checker& check) {
  if (!message.has_centre_m()) return check.Error(path + ".centre_m", "is missing");
  SIGHTLINE_RETURN_IF_ERROR(
      CheckVector(check, path + ".centre_m", message.centre_m(), kBodyCentre));
  const Eigen::Vector3d centre = VectorFromProto(message.centre_m());
  switch (message.shape_case()) {
    case v1::Body::kBox: {
      const std::string field = path + ".box.size_m";
      if (!message.box().has_size_m()) return check.Error(field, "is missing");
      SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, field, message.box().size_m(), kBodyLength));
      return Body(BoxBody{centre, VectorFromProto(message.box().size_m())});
    }
    case v1::Body::kCylinder: {
      const v1::Body::Cylinder& cylinder = message.cylinder();
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range(path + ".cylinder.radius_m", cylinder.radius_m(), kBodyLength));
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range(path + ".cylinder.length_m", cylinder.length_m(), kBodyLength));
      return Body(CylinderBody{centre, cylinder.radius_m(), cylinder.length_m()});
    }
    case v1::Body::SHAPE_NOT_SET:
      break;
  }
  return check.Error(path, "has no shape, must have box or cylinder");
}

template <typename Messages>
absl::Status ParseBodies(const Messages& messages, const std::string& path, const Checker& check,
                         std::vector<Body>* bodies) {
  if (messages.empty()) return absl::OkStatus();  // keeps the default
  bodies->clear();
  for (int i = 0; i < messages.size(); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(Body body,
                               ParseBody(messages[i], absl::StrCat(path, "[", i, "]"), check));
    bodies->push_back(body);
  }
  return absl::OkStatus();
}

// --- targets ------------------------------------------------------------------------------------

constexpr Limits kCoverageRadius{0, 1, " m", true};
constexpr Limits kNormalAngle{0, 90, " deg", true};
constexpr Limits kFootprint{0, 1, " m", true};
constexpr Limits kConfusion{0, 1e4, " px"};
constexpr Limits kIncidence{0, 90, " deg", true};
constexpr Limits kRegionCorner{-1000, 1000, " m"};
constexpr Limits kResolution{1e-5, 1, " m"};

// --- files, goal, costs -------------------------------------------------------------------------

absl::Status CheckMeshFile(const Checker& check, const std::string& path, const std::string& file,
                           const std::string& unit) {
  if (file.empty()) return check.Error(path + ".file", "is missing");
  if (absl::Status status = CheckPartUnit(file, unit); !status.ok()) {
    return check.Error(path + ".unit", std::string(status.message()));
  }
  return absl::OkStatus();
}

absl::StatusOr<GainWeights> ParseGainWeights(const v1::GainWeights& message, const Checker& check) {
  GainWeights weights{message.coverage(), message.admissible(), message.relaxed(),
                      message.information(), message.total_uncertainty()};
  double sum = 0;
  for (const auto& [name, value] :
       {std::pair("coverage", weights.coverage), std::pair("admissible", weights.admissible),
        std::pair("relaxed", weights.relaxed), std::pair("information", weights.information),
        std::pair("total_uncertainty", weights.total_uncertainty)}) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat("goal.gain.", name), value, {0, 1e6, ""}));
    sum += value;
  }
  if (sum == 0) return check.Error("goal.gain", "has no weight above 0");
  return weights;
}

absl::StatusOr<PlanningGoal> ParseGoal(const v1::PlanningGoal& message, const Checker& check) {
  PlanningGoal goal;
  ErrorList errors;
  if (message.has_admissible()) {
    errors.Add(check.Range("goal.admissible", message.admissible(), {0, 1, "", true}));
    if (message.has_coverage()) {
      errors.Add(check.Error("goal.coverage",
                             "cannot be given together with goal.admissible: give coverage a "
                             "weight in goal.gain instead"));
    }
    goal.admissible = message.admissible();
    goal.coverage = 0;
  }
  if (message.has_coverage()) goal.coverage = message.coverage();
  if (!goal.admissible) {
    errors.Add(check.Range("goal.coverage", goal.coverage, kCoverageGoal));
  }
  if (message.has_gain()) {
    if (!goal.admissible) errors.Add(check.Error("goal.gain", "needs goal.admissible"));
    absl::StatusOr<GainWeights> gain = ParseGainWeights(message.gain(), check);
    if (errors.Add(gain.status())) goal.gain = *gain;
  }
  if (message.has_max_scans()) goal.max_scans = message.max_scans();
  errors.Add(check.Range("goal.max_scans", goal.max_scans, {1, 1000, ""}));
  if (message.has_max_time_s()) {
    errors.Add(check.Range("goal.max_time_s", message.max_time_s(), {0, kLargest, " s", true}));
    goal.max_time_s = message.max_time_s();
  }
  if (message.has_min_gain()) goal.min_gain = message.min_gain();
  errors.Add(check.Range("goal.min_gain", goal.min_gain, {0, 1, "", false, true}));
  if (message.has_execution_time_s()) {
    goal.execution_time_s = message.execution_time_s();
    errors.Add(
        check.Range("goal.execution_time_s", *goal.execution_time_s, {0, kLargest, " s", true}));
  }
  const auto count = [&](const char* path, bool given, int value, std::optional<int>* limit) {
    if (!given) return;
    *limit = value;
    errors.Add(check.Range(path, value, {1, 1000, ""}));
  };
  count("goal.max_setups", message.has_max_setups(), message.max_setups(), &goal.max_setups);
  count("goal.max_sensor_places", message.has_max_sensor_places(), message.max_sensor_places(),
        &goal.max_sensor_places);
  count("goal.max_resting_faces", message.has_max_resting_faces(), message.max_resting_faces(),
        &goal.max_resting_faces);
  if (!errors.empty()) return errors.Status();
  return goal;
}

// Seconds of the current defaults (v1::CostModel).
constexpr double kStageSpeed_m_per_s = 0.05;
constexpr double kLayTime_s = 180, kTurnTime_s = 60;
constexpr double kMoveSensorsTime_s = 900, kMoveHeadTime_s = 60;

// Values that the current defaults give to costs that `message` does not state.
void SetDefaultCosts(const v1::Inspection& message, const Inspection& inspection,
                     CostModel* costs) {
  const v1::CostModel& given = message.costs();
  if (!given.has_stage_speed_m_per_s()) costs->stage_speed_m_per_s = kStageSpeed_m_per_s;
  if (!given.has_frame_rate_hz() && message.camera().sensor().has_max_frame_rate_hz()) {
    costs->frame_rate_hz = message.camera().sensor().max_frame_rate_hz();
  }
  if (given.has_reposition_time_s() || given.has_reposition_speed_deg_per_s() ||
      given.has_reposition_speed_m_per_s()) {
    return;
  }
  const std::optional<RobotMount>& robot = inspection.robot;
  const bool holds_part = robot && robot->load == RobotMount::Load::kPart;
  const bool holds_head = robot && robot->load == RobotMount::Load::kSensorHead;
  if (!given.has_lay_time_s() && !holds_part) costs->lay_time_s = kLayTime_s;
  if (!given.has_turn_time_s() && !holds_part) costs->turn_time_s = kTurnTime_s;
  if (!given.has_move_sensors_time_s() && !holds_head) {
    costs->move_sensors_time_s =
        inspection.sensor_mount == SensorMount::kRigid ? kMoveHeadTime_s : kMoveSensorsTime_s;
  }
}

// Placement errors by hand, and by a robot with the repeatability of its data sheet (ISO 9283).
constexpr double kHandPosition_m = 2e-3, kHandAngle_deg = 1;
constexpr double kRobotPosition_m = 1e-4, kRobotAngle_deg = 0.05;

// `rig` has its robot, if any, and its defaults.
absl::StatusOr<PlacementErrors> ParsePlacement(const v1::Placement& message, const Inspection& rig,
                                               const Checker& check) {
  ErrorList errors;
  const bool has_default = rig.defaults != DefaultsVersion::k0_1;
  const auto value = [&](const char* path, bool given, double stated, bool robot, double by_robot,
                         double by_hand, const Limits& range) {
    if (given) errors.Add(check.Range(path, stated, range));
    if (given) return stated;
    if (!has_default) return 0.0;
    return robot ? by_robot : by_hand;
  };
  const Limits position{0, 0.1, " m"}, angle{0, 45, " deg"};
  const bool part = rig.robot && rig.robot->load == RobotMount::Load::kPart;
  const bool head = rig.robot && rig.robot->load == RobotMount::Load::kSensorHead;
  PlacementErrors placement;
  placement.part_position_m =
      value("placement.part_position_m", message.has_part_position_m(), message.part_position_m(),
            part, kRobotPosition_m, kHandPosition_m, position);
  placement.part_angle_rad =
      Radians(value("placement.part_angle_deg", message.has_part_angle_deg(),
                    message.part_angle_deg(), part, kRobotAngle_deg, kHandAngle_deg, angle));
  placement.sensor_position_m =
      value("placement.sensor_position_m", message.has_sensor_position_m(),
            message.sensor_position_m(), head, kRobotPosition_m, kHandPosition_m, position);
  placement.sensor_angle_rad =
      Radians(value("placement.sensor_angle_deg", message.has_sensor_angle_deg(),
                    message.sensor_angle_deg(), head, kRobotAngle_deg, kHandAngle_deg, angle));
  if (!errors.empty()) return errors.Status();
  return placement;
}

absl::StatusOr<CostModel> ParseCosts(const v1::CostModel& message, const Checker& check) {
  CostModel costs;
  ErrorList errors;
  if (message.has_stage_speed_m_per_s()) {
    costs.stage_speed_m_per_s = message.stage_speed_m_per_s();
    errors.Add(check.Range("costs.stage_speed_m_per_s", *costs.stage_speed_m_per_s,
                           {0, 100, " m/s", true}));
  }
  if (message.has_frame_rate_hz()) {
    costs.frame_rate_hz = message.frame_rate_hz();
    errors.Add(check.Range("costs.frame_rate_hz", *costs.frame_rate_hz, {0, 1e6, " Hz", true}));
  }
  if (message.has_reposition_time_s()) {
    costs.reposition_time_s = message.reposition_time_s();
    errors.Add(check.Range("costs.reposition_time_s", *costs.reposition_time_s, {0, 1e6, " s"}));
  }
  if (message.has_reposition_speed_deg_per_s()) {
    errors.Add(check.Range("costs.reposition_speed_deg_per_s", message.reposition_speed_deg_per_s(),
                           {0, 1e6, " deg/s", true}));
    costs.reposition_speed_rad_per_s = Radians(message.reposition_speed_deg_per_s());
  }
  if (message.has_reposition_speed_m_per_s()) {
    costs.reposition_speed_m_per_s = message.reposition_speed_m_per_s();
    errors.Add(check.Range("costs.reposition_speed_m_per_s", *costs.reposition_speed_m_per_s,
                           {0, 100, " m/s", true}));
  }
  costs.lay_time_s = message.lay_time_s();
  costs.turn_time_s = message.turn_time_s();
  costs.move_sensors_time_s = message.move_sensors_time_s();
  for (const auto& [path, time_s] :
       {std::pair("costs.lay_time_s", costs.lay_time_s),
        std::pair("costs.turn_time_s", costs.turn_time_s),
        std::pair("costs.move_sensors_time_s", costs.move_sensors_time_s)}) {
    errors.Add(check.Range(path, time_s, {0, 1e6, " s"}));
  }
  if (!errors.empty()) return errors.Status();
  return costs;
}

// rig.sensor_mount with its conditions on the domain, and rig.stage_moves_in_height.
absl::Status ParseSensorMount(const v1::Inspection& message, const Checker& check,
                              Inspection* inspection) {
  const v1::Rig& rig = message.rig();
  inspection->stage_moves_in_height =
      !rig.has_stage_moves_in_height() || rig.stage_moves_in_height();
  switch (rig.sensor_mount()) {
    case v1::Rig::SENSOR_MOUNT_UNSPECIFIED:
    case v1::Rig::SENSOR_MOUNT_SEPARATE:
      return absl::OkStatus();
    case v1::Rig::SENSOR_MOUNT_RIGID:
      break;
    default:
      return check.Error("rig.sensor_mount", "is unknown");
  }
  inspection->sensor_mount = SensorMount::kRigid;
  for (const int parameter : {kCameraDistance, kTriangulationAngle}) {
    if (!inspection->domain.parameters[parameter].values.empty()) continue;
    return check.Error(absl::StrCat("measurement.", kMeasurementParameterNames[parameter]),
                       "must be one value (fixed) or a list of values: with rig.sensor_mount "
                       "SENSOR_MOUNT_RIGID the housing determines it");
  }
  return absl::OkStatus();
}

absl::StatusOr<DefaultsVersion> ParseDefaults(const v1::Inspection& message, const Checker& check) {
  if (message.defaults().empty() || message.defaults() == kCurrentDefaults) {
    return DefaultsVersion::k0_2;
  }
  if (message.defaults() == "0.1") return DefaultsVersion::k0_1;
  return check.Error("defaults", absl::StrCat("is \"", message.defaults(),
                                              "\", must be \"0.1\" or \"", kCurrentDefaults, "\""));
}

v1::Vector3 FromVector(const Eigen::Vector3d& v) {
  v1::Vector3 message;
  message.set_x(v.x());
  message.set_y(v.y());
  message.set_z(v.z());
  return message;
}

v1::Body BodyToProto(const Body& body) {
  v1::Body message;
  if (const auto* box = std::get_if<BoxBody>(&body)) {
    *message.mutable_centre_m() = FromVector(box->centre_m);
    *message.mutable_box()->mutable_size_m() = FromVector(box->size_m);
  } else {
    const auto& cylinder = std::get<CylinderBody>(body);
    *message.mutable_centre_m() = FromVector(cylinder.centre_m);
    message.mutable_cylinder()->set_radius_m(cylinder.radius_m);
    message.mutable_cylinder()->set_length_m(cylinder.length_m);
  }
  return message;
}

}  // namespace

bool CostModel::IsUnit() const {
  return !stage_speed_m_per_s && !frame_rate_hz && !reposition_time_s &&
         !reposition_speed_rad_per_s && !reposition_speed_m_per_s && lay_time_s == 0 &&
         turn_time_s == 0 && move_sensors_time_s == 0;
}

absl::StatusOr<Rig> ParseRig(const v1::Rig& message, const v1::Camera& camera, const v1::Lens* lens,
                             const v1::Laser& laser, const std::string& context) {
  const Checker check(context);
  Rig rig;
  ErrorList errors;
  if (lens != nullptr) {
    absl::StatusOr<Lens> parsed = ParseLens(*lens, context);
    if (errors.Add(parsed.status())) rig.lens = *std::move(parsed);
  }
  absl::StatusOr<Camera> parsed_camera = ParseCamera(camera, rig.lens, context);
  if (errors.Add(parsed_camera.status())) rig.camera = *parsed_camera;
  absl::StatusOr<Laser> parsed_laser = ParseLaser(laser, context);
  if (errors.Add(parsed_laser.status())) rig.laser = *parsed_laser;
  if (message.has_scan_step_m()) rig.scan_step_m = message.scan_step_m();
  errors.Add(check.Range("rig.scan_step_m", rig.scan_step_m, kScanStep));
  if (message.has_stage_travel_m()) rig.stage_travel_m = message.stage_travel_m();
  errors.Add(check.Range("rig.stage_travel_m", rig.stage_travel_m, kStageTravel));
  if (message.has_max_range_m()) rig.max_range_m = message.max_range_m();
  errors.Add(check.Range("rig.max_range_m", rig.max_range_m, kMaxRange));
  rig.clearance_m = message.clearance_m();
  errors.Add(check.Range("rig.clearance_m", rig.clearance_m, kClearance));
  errors.Add(ParseBodies(message.camera_bodies(), "rig.camera_bodies", check, &rig.camera_bodies));
  errors.Add(ParseBodies(message.laser_bodies(), "rig.laser_bodies", check, &rig.laser_bodies));
  if (!errors.empty()) return errors.Status();
  return rig;
}

namespace {

absl::StatusOr<TargetRegion> ParseTargetRegion(const v1::TargetRegion& region,
                                               const std::string& path, const Checker& check) {
  ErrorList errors;
  for (const auto& [given, name] :
       {std::pair(!region.name().empty(), ".name"), std::pair(region.has_min_m(), ".min_m"),
        std::pair(region.has_max_m(), ".max_m"), std::pair(region.has_spacing_m(), ".spacing_m")}) {
    if (!given) errors.Add(check.Error(path + name, "is missing"));
  }
  if (!errors.empty()) return errors.Status();
  errors.Add(CheckVector(check, path + ".min_m", region.min_m(), kRegionCorner));
  errors.Add(CheckVector(check, path + ".max_m", region.max_m(), kRegionCorner));
  const Eigen::Vector3d min = VectorFromProto(region.min_m()),
                        max = VectorFromProto(region.max_m());
  for (int axis = 0; axis < 3; ++axis) {
    if (min[axis] < max[axis]) continue;
    const std::string letter(1, "xyz"[axis]);
    errors.Add(check.Error(absl::StrCat(path, ".max_m.", letter),
                           absl::StrCat("is ", NumberText(max[axis]), ", must be above min_m.",
                                        letter, " = ", NumberText(min[axis]))));
  }
  errors.Add(check.Range(path + ".spacing_m", region.spacing_m(), kTargetSpacing));
  TargetRegion parsed{region.name(), min, max, region.spacing_m()};
  if (region.has_resolution_m()) {
    errors.Add(check.Range(path + ".resolution_m", region.resolution_m(), kResolution));
    parsed.resolution_m = region.resolution_m();
  }
  if (!errors.empty()) return errors.Status();
  return parsed;
}

}  // namespace

absl::StatusOr<TargetSampling> ParseTargetSampling(const v1::TargetSampling& message,
                                                   const std::string& context) {
  const Checker check(context);
  TargetSampling sampling;
  ErrorList errors;
  if (message.has_spacing_m()) sampling.spacing_m = message.spacing_m();
  errors.Add(check.Range("targets.spacing_m", sampling.spacing_m, kTargetSpacing));
  if (message.has_coverage_radius_m()) sampling.coverage_radius_m = message.coverage_radius_m();
  errors.Add(check.Range("targets.coverage_radius_m", sampling.coverage_radius_m, kCoverageRadius));
  if (message.has_max_normal_angle_deg()) {
    errors.Add(
        check.Range("targets.max_normal_angle_deg", message.max_normal_angle_deg(), kNormalAngle));
    sampling.max_normal_angle_rad = Radians(message.max_normal_angle_deg());
  }
  if (message.has_seed()) sampling.seed = message.seed();
  std::set<std::string> names;
  for (int i = 0; i < message.regions_size(); ++i) {
    const v1::TargetRegion& region = message.regions(i);
    const std::string path = absl::StrCat("targets.regions[", i, "]");
    if (!region.name().empty() && !names.insert(region.name()).second) {
      errors.Add(check.Error(
          path + ".name", absl::StrCat("is \"", region.name(), "\" like that of another region")));
    }
    absl::StatusOr<TargetRegion> parsed = ParseTargetRegion(region, path, check);
    if (errors.Add(parsed.status())) sampling.regions.push_back(*std::move(parsed));
    if (errors.full()) break;
  }
  if (message.has_max_pixel_footprint_m()) {
    errors.Add(
        check.Range("targets.max_pixel_footprint_m", message.max_pixel_footprint_m(), kFootprint));
    sampling.max_pixel_footprint_m = message.max_pixel_footprint_m();
  }
  if (message.has_max_circle_of_confusion_px()) {
    errors.Add(check.Range("targets.max_circle_of_confusion_px",
                           message.max_circle_of_confusion_px(), kConfusion));
    sampling.max_circle_of_confusion_px = message.max_circle_of_confusion_px();
  }
  if (message.has_max_depth_per_pixel_m()) {
    errors.Add(
        check.Range("targets.max_depth_per_pixel_m", message.max_depth_per_pixel_m(), kFootprint));
    sampling.max_depth_per_pixel_m = message.max_depth_per_pixel_m();
  }
  if (message.has_max_incidence_deg()) {
    errors.Add(check.Range("targets.max_incidence_deg", message.max_incidence_deg(), kIncidence));
    sampling.max_incidence_rad = Radians(message.max_incidence_deg());
  }
  if (message.has_required_resolution_m()) {
    errors.Add(check.Range("targets.required_resolution_m", message.required_resolution_m(),
                           {0, 1, " m"}));
  }
  if (!errors.empty()) return errors.Status();
  return sampling;
}

absl::Status CheckLimitInputs(const Rig& rig, const TargetSampling& sampling,
                              const std::string& context) {
  if (sampling.max_circle_of_confusion_px.value_or(0) == 0) return absl::OkStatus();
  const Checker check(context);
  const std::string needed = "is missing: targets.max_circle_of_confusion_px needs it";
  if (!rig.lens) return check.Error("lens", needed);
  if (!rig.camera.pixel_pitch_m) return check.Error("camera.pixel_pitch_m", needed);
  return absl::OkStatus();
}

namespace {

absl::StatusOr<TolerancedRegion> ParseTolerancedRegion(const v1::TolerancedRegion& message,
                                                       const std::string& path, bool has_file,
                                                       const Checker& check) {
  TolerancedRegion region;
  region.name = message.name();
  if (region.name.empty()) return check.Error(path + ".name", "is missing");
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range(path + ".zone_width_m", message.zone_width_m(), kZoneWidth));
  region.zone_width_m = message.zone_width_m();
  const bool box = message.has_min_m() || message.has_max_m();
  const int given = box + !message.materials().empty() + !message.faces().empty();
  if (given != 1) {
    return check.Error(path, absl::StrCat("has ", given == 0 ? "none" : "several",
                                          " of min_m with max_m, materials, faces, must have "
                                          "exactly one"));
  }
  if (box) {
    if (!message.has_min_m()) return check.Error(path + ".min_m", "is missing");
    if (!message.has_max_m()) return check.Error(path + ".max_m", "is missing");
    SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, path + ".min_m", message.min_m(), kRegionCorner));
    SIGHTLINE_RETURN_IF_ERROR(CheckVector(check, path + ".max_m", message.max_m(), kRegionCorner));
    const Eigen::AlignedBox3d bounds(VectorFromProto(message.min_m()),
                                     VectorFromProto(message.max_m()));
    if ((bounds.sizes().array() <= 0).any()) {
      return check.Error(path + ".max_m", "must be above min_m along every axis");
    }
    region.box_m = bounds;
  }
  region.materials.assign(message.materials().begin(), message.materials().end());
  if (!message.faces().empty() && !has_file) {
    return check.Error(path + ".faces", "needs tolerances.file, a STEP file");
  }
  for (int i = 0; i < message.faces_size(); ++i) {
    if (message.faces(i) < 1) {
      return check.Error(absl::StrCat(path, ".faces[", i, "]"),
                         absl::StrCat("is ", message.faces(i), ", must be at least 1"));
    }
    region.faces.push_back(message.faces(i));
  }
  return region;
}

// The unit that is stated for the file of the tolerances; empty: none. The part's own file has the
// part's.
absl::StatusOr<std::string> ToleranceFileUnit(const v1::Inspection& message, const Checker& check) {
  const v1::ToleranceRequirements& tolerances = message.tolerances();
  const bool own = !tolerances.file().empty() && tolerances.file() == message.part().file();
  if (tolerances.unit().empty()) return own ? message.part().unit() : std::string();
  if (tolerances.file().empty()) {
    return check.Error("tolerances.unit", "is given without tolerances.file");
  }
  absl::StatusOr<std::string> unit = LengthUnitNamed(tolerances.unit());
  if (!unit.ok()) return check.Error("tolerances.unit", std::string(unit.status().message()));
  if (own && *unit != LengthUnitNamed(message.part().unit()).value_or("")) {
    return check.Error(
        "tolerances.unit",
        absl::StrCat("is ", *unit, ", but part.unit of the same file is ",
                     message.part().unit().empty() ? "not given" : message.part().unit()));
  }
  return unit;
}

// Values that the current defaults give to an uncertainty model that `message` does not state.
void SetDefaultUncertainty(const v1::Uncertainty& message, UncertaintyModel* model) {
  if (!message.has_calibration()) {
    model->calibration = CalibrationOnSite();
    model->calibration_assumed = true;
  }
  if (message.registration() == v1::Uncertainty::REGISTRATION_UNSPECIFIED) {
    model->registration = RegistrationMethod::kBestFit;
  }
}

// Uncertainty model, tolerances, and the conditions of an uncertainty goal on both.
absl::Status ParseUncertaintyGoal(const v1::Inspection& message, const Checker& check,
                                  const std::string& context, Inspection* inspection) {
  if (message.has_uncertainty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(inspection->uncertainty,
                               ParseUncertainty(message.uncertainty(), context));
    if (!message.rig().has_scan_step_m()) {
      // With points a sixth of the resolution apart, the surface between them is determined.
      double finest_m = inspection->uncertainty->resolution_m;
      for (const TargetRegion& region : inspection->targets.regions) {
        finest_m = std::min(finest_m, region.resolution_m.value_or(finest_m));
      }
      inspection->rig.scan_step_m = std::min(inspection->rig.scan_step_m, finest_m / 6);
    }
  }
  if (message.has_tolerances()) {
    const v1::ToleranceRequirements& given = message.tolerances();
    ToleranceRequirements requirements;
    if (given.has_zone_width_m()) {
      SIGHTLINE_RETURN_IF_ERROR(
          check.Range("tolerances.zone_width_m", given.zone_width_m(), kZoneWidth));
      requirements.zone_width_m = given.zone_width_m();
    }
    if (given.has_guard_factor()) requirements.guard_factor = given.guard_factor();
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range("tolerances.guard_factor", requirements.guard_factor, {0, 100, "", true}));
    requirements.least_acceptance_zone = given.least_acceptance_zone();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("tolerances.least_acceptance_zone",
                                          requirements.least_acceptance_zone,
                                          {0, 1, "", false, true}));
    if (given.has_relaxed_uncertainty_m()) {
      SIGHTLINE_RETURN_IF_ERROR(check.Range("tolerances.relaxed_uncertainty_m",
                                            given.relaxed_uncertainty_m(), kZoneWidth));
      requirements.relaxed_uncertainty_m = given.relaxed_uncertainty_m();
    }
    if (given.association() == v1::ToleranceRequirements::CHEBYSHEV) {
      requirements.association = Association::kChebyshev;
      if (given.file().empty()) {
        return check.Error("tolerances.association",
                           "is CHEBYSHEV, which needs tolerances.file: zones by hand are relative "
                           "to the model, to which nothing is fitted");
      }
    }
    requirements.file = given.file();
    SIGHTLINE_ASSIGN_OR_RETURN(requirements.file_unit, ToleranceFileUnit(message, check));
    constexpr int kMaxRegions = 10000;
    if (given.regions_size() > kMaxRegions) {
      return check.Error("tolerances.regions", absl::StrCat("has ", given.regions_size(),
                                                            " entries, at most ", kMaxRegions));
    }
    ErrorList errors;
    for (int i = 0; i < given.regions_size() && !errors.full(); ++i) {
      absl::StatusOr<TolerancedRegion> region =
          ParseTolerancedRegion(given.regions(i), absl::StrCat("tolerances.regions[", i, "]"),
                                !given.file().empty(), check);
      if (errors.Add(region.status())) requirements.regions.push_back(*std::move(region));
    }
    if (!errors.empty()) return errors.Status();
    if (!requirements.zone_width_m && requirements.file.empty() && requirements.regions.empty()) {
      return check.Error("tolerances", "has none of zone_width_m, file, regions");
    }
    inspection->tolerances = std::move(requirements);
  }
  ErrorList missing;
  if (inspection->goal.admissible) {
    if (!inspection->uncertainty) {
      missing.Add(check.Error("uncertainty", "is missing: goal.admissible needs it"));
    }
    if (!inspection->tolerances) {
      missing.Add(check.Error("tolerances", "is missing: goal.admissible needs it"));
    }
  }
  return missing.Status();
}

}  // namespace

namespace {

absl::StatusOr<ObstacleSource> ParseObstacle(const v1::Obstacle& obstacle, const std::string& path,
                                             const Checker& check) {
  ErrorList errors;
  errors.Add(CheckMeshFile(check, path, obstacle.file(), obstacle.unit()));
  const std::optional<ObstacleFrame> frame = ObstacleFrameFromProto(obstacle.frame());
  if (!frame) {
    errors.Add(
        check.Error(path + ".frame", absl::StrCat("is missing, must be ", kObstacleFrameNames)));
  }
  if (!errors.empty()) return errors.Status();
  return ObstacleSource{obstacle.name(), obstacle.file(), obstacle.unit(), *frame};
}

}  // namespace

namespace {

// Parses the limits by light, if the inspection states them.
absl::Status ParseLightLimit(const v1::Inspection& message, const Checker& check,
                             const std::string& context, Inspection* inspection) {
  if (!message.has_detectability()) return absl::OkStatus();
  SIGHTLINE_ASSIGN_OR_RETURN(inspection->detectability,
                             ParseDetectability(message.detectability(), context));
  if (!inspection->detectability->materials.empty()) {
    if (!message.detectability().has_min_detected_fraction()) return absl::OkStatus();
    return check.Error("detectability.min_detected_fraction",
                       "has no effect beside detectability.table, whose times were computed with "
                       "a fraction of their own: leave one of the two out");
  }
  ErrorList missing;
  for (const auto& [given, name] : {std::pair(message.camera().has_sensor(), "camera.sensor"),
                                    std::pair(message.has_lens(), "lens"),
                                    std::pair(message.laser().has_power_w(), "laser.power_w")}) {
    if (given) continue;
    missing.Add(check.Error(name, "is missing: detectability without a table needs it"));
  }
  return missing.Status();
}

}  // namespace

absl::StatusOr<Inspection> ParseInspection(const v1::Inspection& given, const std::string& context,
                                           const std::string& base_folder) {
  ErrorList errors;
  v1::Inspection message;
  const bool inlined = errors.Add(InlineFiles(given, context, base_folder, &message));
  const auto take = [&errors](auto parsed, auto* value) {
    const bool ok = errors.Add(parsed.status());
    if (ok) *value = *std::move(parsed);
    return ok;
  };
  const Checker check(context);
  Inspection inspection;
  inspection.name = message.name();
  errors.Add(CheckMeshFile(check, "part", message.part().file(), message.part().unit()));
  inspection.part_file = message.part().file();
  inspection.part_unit = message.part().unit();
  inspection.part_construction_geometry = message.part().construction_geometry();

  const bool rig_ok =
      take(ParseRig(message.rig(), message.camera(), message.has_lens() ? &message.lens() : nullptr,
                    message.laser(), context),
           &inspection.rig);
  const bool targets_ok =
      take(ParseTargetSampling(message.targets(), context), &inspection.targets);
  if (message.targets().has_required_resolution_m()) {
    inspection.required_resolution_m = message.targets().required_resolution_m();
  }
  // Limits may come from a file that could not be read, so nothing is reported missing then.
  if (inlined && rig_ok && targets_ok) {
    errors.Add(CheckLimitInputs(inspection.rig, inspection.targets, context));
  }
  inspection.offset_y_given = message.measurement().has_offset_y_m();
  inspection.offset_z_given = message.measurement().has_offset_z_m();
  if (take(ParseMeasurementDomain(message.measurement(), context), &inspection.domain)) {
    errors.Add(ParsePartHolding(message, context, &inspection));
    if (message.rig().has_robot()) {
      absl::StatusOr<RobotMount> robot = ParseRobotMount(message, inspection.domain, context);
      if (errors.Add(robot.status())) inspection.robot = *std::move(robot);
    }
    errors.Add(ParseSensorMount(message, check, &inspection));
  }
  for (int i = 0; i < message.obstacles_size() && !errors.full(); ++i) {
    auto obstacle = ParseObstacle(message.obstacles(i), absl::StrCat("obstacles[", i, "]"), check);
    if (errors.Add(obstacle.status())) inspection.obstacles.push_back(*std::move(obstacle));
  }
  if (take(ParseGoal(message.goal(), check), &inspection.goal)) {
    errors.Add(ParseUncertaintyGoal(message, check, context, &inspection));
  }
  take(ParseDefaults(message, check), &inspection.defaults);
  if (inspection.defaults != DefaultsVersion::k0_1 && !message.rig().has_clearance_m()) {
    inspection.rig.clearance_m = kDefaultClearance_m;
  }
  if (inspection.defaults != DefaultsVersion::k0_1 && inspection.uncertainty) {
    SetDefaultUncertainty(message.uncertainty(), &*inspection.uncertainty);
  }
  if (take(ParseCosts(message.costs(), check), &inspection.stated_costs)) {
    inspection.costs = inspection.stated_costs;
    if (inspection.defaults != DefaultsVersion::k0_1) {
      SetDefaultCosts(message, inspection, &inspection.costs);
    }
  }
  take(ParsePlacement(message.placement(), inspection, check), &inspection.placement);
  errors.Add(ParseImaging(message, context, &inspection));
  if (inspection.rig.lens) {
    if (take(ParseOpticsPlanning(message.optics(), *inspection.rig.lens, context),
             &inspection.optics) &&
        inspection.defaults == DefaultsVersion::k0_1 &&
        !message.optics().has_max_clipped_fraction()) {
      inspection.optics->max_clipped_fraction = 1;
    }
  } else if (message.has_optics() && !message.has_lens()) {
    errors.Add(check.Error("optics", "is given without a lens"));
  }
  errors.Add(ParseLightLimit(message, check, context, &inspection));
  if (!errors.empty()) return errors.Status();
  return inspection;
}

namespace {

// Camera and material files are read, so that their absence shows anyway.
absl::Status CheckMeshFilesExist(const v1::Inspection& message, const std::string& context,
                                 const std::filesystem::path& base_folder) {
  ErrorList errors;
  const auto check = [&](const std::string& field, const std::string& file) {
    std::error_code error;
    if (file.empty() || errors.full() || std::filesystem::exists(base_folder / file, error)) return;
    errors.Add(absl::NotFoundError(absl::StrCat(context, ": ", field, ": no file ",
                                                (base_folder / file).lexically_normal().string())));
  };
  check("part.file", message.part().file());
  for (int i = 0; i < message.obstacles_size(); ++i) {
    check(absl::StrCat("obstacles[", i, "].file"), message.obstacles(i).file());
  }
  check("tolerances.file", message.tolerances().file());
  return errors.Status();
}

}  // namespace

absl::StatusOr<Inspection> ReadInspection(const std::string& path) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &message));
  return ParseInspection(message, path, std::filesystem::path(path).parent_path().string());
}

absl::StatusOr<Inspection> ReadInspectionWithFiles(const std::string& path) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(path, &message));
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  absl::StatusOr<Inspection> inspection = ParseInspection(message, path, folder.string());
  ErrorList errors;
  errors.Add(inspection.status());
  errors.Add(CheckMeshFilesExist(message, path, folder));
  if (!errors.empty()) return errors.Status();
  return inspection;
}

void DeriveLimits(Inspection* inspection) {
  constexpr double kMaxIncidence_deg = 70, kMaxConfusion_px = 2;
  if (inspection->defaults != DefaultsVersion::k0_1) {
    TargetSampling& sampling = inspection->targets;
    if (!sampling.max_incidence_rad) sampling.max_incidence_rad = Radians(kMaxIncidence_deg);
    if (!sampling.max_circle_of_confusion_px && inspection->rig.lens &&
        inspection->rig.camera.pixel_pitch_m) {
      sampling.max_circle_of_confusion_px = kMaxConfusion_px;
    }
  }
  const double resolution_m =
      inspection->required_resolution_m.value_or(inspection->targets.coverage_radius_m);
  if (resolution_m == 0 || inspection->goal.admissible) return;
  TargetSampling& targets = inspection->targets;
  if (!targets.max_pixel_footprint_m) targets.max_pixel_footprint_m = resolution_m / 2;
  if (!targets.max_depth_per_pixel_m) targets.max_depth_per_pixel_m = resolution_m;
}

Measurement MeasurementFromProto(const v1::Measurement& m) {
  return {m.camera_distance_m(),
          Radians(m.triangulation_angle_deg()),
          Radians(m.camera_azimuth_deg()),
          Radians(m.camera_polar_deg()),
          Radians(m.part_alpha_deg()),
          Radians(m.part_beta_deg()),
          Radians(m.part_gamma_deg()),
          m.offset_y_m(),
          m.offset_z_m()};
}

v1::Measurement MeasurementToProto(const Measurement& m) {
  v1::Measurement message;
  message.set_camera_distance_m(m.camera_distance_m);
  message.set_triangulation_angle_deg(Degrees(m.triangulation_angle_rad));
  message.set_camera_azimuth_deg(Degrees(m.camera_azimuth_rad));
  message.set_camera_polar_deg(Degrees(m.camera_polar_rad));
  message.set_part_alpha_deg(Degrees(m.part_alpha_rad));
  message.set_part_beta_deg(Degrees(m.part_beta_rad));
  message.set_part_gamma_deg(Degrees(m.part_gamma_rad));
  message.set_offset_y_m(m.offset_y_m);
  message.set_offset_z_m(m.offset_z_m);
  return message;
}

v1::Camera CameraToProto(const Camera& camera) {
  v1::Camera message;
  message.set_columns_px(camera.columns_px);
  message.set_rows_px(camera.rows_px);
  message.set_vertical_fov_deg(Degrees(camera.vertical_fov_rad));
  if (camera.pixel_pitch_m) message.set_pixel_pitch_m(*camera.pixel_pitch_m);
  return message;
}

v1::Laser LaserToProto(const Laser& laser) {
  v1::Laser message;
  if (laser.distance_m) message.set_distance_m(*laser.distance_m);
  message.set_fan_angle_deg(Degrees(laser.fan_angle_rad));
  return message;
}

v1::Rig RigToProto(const Rig& rig) {
  v1::Rig message;
  message.set_scan_step_m(rig.scan_step_m);
  message.set_stage_travel_m(rig.stage_travel_m);
  message.set_max_range_m(rig.max_range_m);
  message.set_clearance_m(rig.clearance_m);
  for (const Body& body : rig.camera_bodies) *message.add_camera_bodies() = BodyToProto(body);
  for (const Body& body : rig.laser_bodies) *message.add_laser_bodies() = BodyToProto(body);
  return message;
}

v1::TargetSampling TargetSamplingToProto(const TargetSampling& sampling) {
  v1::TargetSampling message;
  message.set_spacing_m(sampling.spacing_m);
  message.set_coverage_radius_m(sampling.coverage_radius_m);
  message.set_max_normal_angle_deg(Degrees(sampling.max_normal_angle_rad));
  message.set_seed(sampling.seed);
  for (const TargetRegion& region : sampling.regions) {
    v1::TargetRegion* out = message.add_regions();
    out->set_name(region.name);
    *out->mutable_min_m() = FromVector(region.min_m);
    *out->mutable_max_m() = FromVector(region.max_m);
    out->set_spacing_m(region.spacing_m);
    if (region.resolution_m) out->set_resolution_m(*region.resolution_m);
  }
  if (sampling.max_pixel_footprint_m) {
    message.set_max_pixel_footprint_m(*sampling.max_pixel_footprint_m);
  }
  if (sampling.max_circle_of_confusion_px) {
    message.set_max_circle_of_confusion_px(*sampling.max_circle_of_confusion_px);
  }
  if (sampling.max_depth_per_pixel_m) {
    message.set_max_depth_per_pixel_m(*sampling.max_depth_per_pixel_m);
  }
  if (sampling.max_incidence_rad) {
    message.set_max_incidence_deg(Degrees(*sampling.max_incidence_rad));
  }
  return message;
}

}  // namespace sightline
