// SPDX-License-Identifier: Apache-2.0
#include "planner_client/exports/export_files.h"

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planner_client/exports/scan_frames.h"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kWorld[] = "world";

// Millimetres of metres that are decimal numbers, such as multiples of the scan step: 0.0055 m is
// 5.5 mm, and not 5.499999999999999.
std::string MillimetreText(double length_m) {
  return NumberText(std::round(1e15 * length_m) / 1e12);
}

std::string FrameName(int scan, const char* what) {
  return absl::StrFormat("scan_%02d_%s", scan, what);
}

struct NamedFrame {
  const char* name;
  Eigen::Isometry3d pose;
};

// All of one scan, in the order in which files have them.
std::vector<NamedFrame> FramesInOrder(const ScanFrames& frames) {
  return {{"camera", frames.camera}, {"laser", frames.laser}, {"part", frames.part}};
}

// Distance of two triggers; 0 with less than two.
double PitchM(const v1::PlannedScan& scan) {
  const int count = scan.trigger_positions_m_size();
  return count > 1 ? (scan.stage_end_m() - scan.stage_start_m()) / (count - 1) : 0;
}

std::string ScansCsv(const v1::Plan& plan, const std::vector<ScanFrames>& frames) {
  std::vector<std::string> head = {"scan", "stage_start_mm", "stage_end_mm", "triggers_count",
                                   "trigger_pitch_mm"};
  for (const char* frame : {"camera", "laser", "part"}) {
    for (const char* value : {"x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"}) {
      head.push_back(absl::StrCat(frame, "_", value));
    }
  }
  std::string csv = absl::StrCat(absl::StrJoin(head, ","), "\n");
  for (int i = 0; i < plan.scans_size(); ++i) {
    const v1::PlannedScan& scan = plan.scans(i);
    std::vector<std::string> row = {
        absl::StrCat(scan.index()), MillimetreText(scan.stage_start_m()),
        MillimetreText(scan.stage_end_m()), absl::StrCat(scan.trigger_positions_m_size()),
        MillimetreText(PitchM(scan))};
    for (const NamedFrame& frame : FramesInOrder(frames[static_cast<size_t>(i)])) {
      for (const double place_m : frame.pose.translation()) {
        row.push_back(NumberText(1e3 * place_m));
      }
      // Eigen's order: x, y, z, w.
      const Eigen::Quaterniond quaternion = QuaternionOf(frame.pose);
      for (const double value : quaternion.coeffs()) row.push_back(NumberText(value));
    }
    absl::StrAppend(&csv, absl::StrJoin(row, ","), "\n");
  }
  return csv;
}

std::string TriggersCsv(const v1::Plan& plan) {
  std::string csv = "scan,frame,stage_position_mm\n";
  for (const v1::PlannedScan& scan : plan.scans()) {
    for (int frame = 0; frame < scan.trigger_positions_m_size(); ++frame) {
      absl::StrAppend(&csv, scan.index(), ",", frame, ",",
                      MillimetreText(scan.trigger_positions_m(frame)), "\n");
    }
  }
  return csv;
}

std::string PosesJson(const v1::Plan& plan, const std::vector<ScanFrames>& frames) {
  Json json;
  json["format"] = "sightline-poses";
  json["format_version"] = 1;
  json["inspection_name"] = plan.inspection_name();
  json["part_digest"] = plan.part_digest();
  json["units"] = "metres; matrices are 4 x 4, row by row: x_parent = M [x; 1]";
  json["frames"] = {
      {"world",
       "origin where the camera's axis meets the laser plane, x the stage's travel, z up; "
       "it stands still"},
      {"camera",
       "origin at the entrance pupil, z the viewing direction, x along the image rows, y "
       "down in the image"},
      {"laser", "origin at the source, z the middle of the fan, x along the line, y across it"},
      {"part",
       "coordinates of the CAD file; the pose is that with the stage at 0, and the stage "
       "adds its position to x"}};
  json["scans"] = Json::array();
  for (int i = 0; i < plan.scans_size(); ++i) {
    Json scan = {{"scan", plan.scans(i).index()},
                 {"stage_start_m", plan.scans(i).stage_start_m()},
                 {"stage_end_m", plan.scans(i).stage_end_m()}};
    for (const NamedFrame& frame : FramesInOrder(frames[static_cast<size_t>(i)])) {
      Json matrix = Json::array();
      for (int k = 0; k < 16; ++k) matrix.push_back(frame.pose.matrix()(k / 4, k % 4));
      scan[frame.name] = {{"parent", kWorld}, {"matrix", std::move(matrix)}};
    }
    json["scans"].push_back(std::move(scan));
  }
  // Names are checked to be UTF-8 where they are read; anything else would be an exception here.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

// YAML 1.1, which ROS reads, takes 1e-17 for a word and 1.0e-17 for a number.
std::string YamlNumber(double value) {
  std::string text = NumberText(value);
  const size_t exponent = text.find('e');
  if (exponent == std::string::npos || text.find('.') != std::string::npos) return text;
  return absl::StrCat(text.substr(0, exponent), ".0", text.substr(exponent));
}

// "{x: 0.1, y: 0, z: 0}": flow style keeps a pose on two lines.
std::string YamlVector(const Eigen::Vector3d& v) {
  return absl::StrCat("{x: ", YamlNumber(v.x()), ", y: ", YamlNumber(v.y()),
                      ", z: ", YamlNumber(v.z()), "}");
}

std::string YamlQuaternion(const Eigen::Quaterniond& q) {
  return absl::StrCat("{x: ", YamlNumber(q.x()), ", y: ", YamlNumber(q.y()),
                      ", z: ", YamlNumber(q.z()), ", w: ", YamlNumber(q.w()), "}");
}

std::string CameraPosesYaml(const std::vector<ScanFrames>& frames) {
  std::string yaml = absl::StrCat(
      "# geometry_msgs/PoseArray: the camera of every scan, in the order of the plan; metres.\n"
      "# Optical frame: z forwards, x to the right, y down in the image.\n"
      "header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ",
      kWorld, "\nposes:", frames.empty() ? " []" : "", "\n");
  for (const ScanFrames& scan : frames) {
    absl::StrAppend(&yaml, "  - position: ", YamlVector(scan.camera.translation()),
                    "\n    orientation: ", YamlQuaternion(QuaternionOf(scan.camera)), "\n");
  }
  return yaml;
}

// Roll, pitch, yaw of URDF: R = Rz(yaw) Ry(pitch) Rx(roll). Where the pitch is a right angle, roll
// and yaw turn about one axis: the roll is 0.
Eigen::Vector3d RollPitchYaw(const Eigen::Matrix3d& r) {
  const double cosine = std::hypot(r(0, 0), r(1, 0));
  const double pitch = std::atan2(-r(2, 0), cosine);
  if (cosine < 1e-12) return {0, pitch, std::atan2(-r(0, 1), r(1, 1))};
  return {std::atan2(r(2, 1), r(2, 2)), pitch, std::atan2(r(1, 0), r(0, 0))};
}

std::string TransformsYaml(const v1::Plan& plan, const std::vector<ScanFrames>& frames) {
  std::string yaml =
      "# geometry_msgs/TransformStamped of camera, laser and part of every scan; metres. The part "
      "is that\n# with the stage at 0. urdf: the same as the origin of a fixed joint, rpy in "
      "radians.\n";
  absl::StrAppend(&yaml, "transforms:", frames.empty() ? " []" : "", "\n");
  for (int i = 0; i < plan.scans_size(); ++i) {
    for (const NamedFrame& frame : FramesInOrder(frames[static_cast<size_t>(i)])) {
      const Eigen::Vector3d xyz = frame.pose.translation();
      const Eigen::Vector3d rpy = RollPitchYaw(frame.pose.linear());
      const auto list = [](const Eigen::Vector3d& v) {
        return absl::StrCat("[", YamlNumber(v.x()), ", ", YamlNumber(v.y()), ", ",
                            YamlNumber(v.z()), "]");
      };
      absl::StrAppend(&yaml, "  - header: {stamp: {sec: 0, nanosec: 0}, frame_id: ", kWorld,
                      "}\n    child_frame_id: ", FrameName(plan.scans(i).index(), frame.name),
                      "\n    transform:\n      translation: ", YamlVector(xyz),
                      "\n      rotation: ", YamlQuaternion(QuaternionOf(frame.pose)),
                      "\n    urdf: {xyz: ", list(xyz), ", rpy: ", list(rpy), "}\n");
    }
  }
  return yaml;
}

}  // namespace

absl::StatusOr<std::vector<ExportFile>> ExportPlan(const v1::Plan& plan) {
  std::vector<ScanFrames> frames;
  for (const v1::PlannedScan& scan : plan.scans()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto of_scan, FramesOfScan(scan));
    frames.push_back(std::move(of_scan));
  }
  return std::vector<ExportFile>{{"scans.csv", ScansCsv(plan, frames)},
                                 {"triggers.csv", TriggersCsv(plan)},
                                 {"poses.json", PosesJson(plan, frames)},
                                 {"camera_poses.yaml", CameraPosesYaml(frames)},
                                 {"transforms.yaml", TransformsYaml(plan, frames)}};
}

}  // namespace sightline
