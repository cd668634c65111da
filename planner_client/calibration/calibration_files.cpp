// SPDX-License-Identifier: Apache-2.0
#include "planner_client/calibration/calibration_files.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "absl/strings/str_format.h"
#include "core/scanner_calibration/calibration_verdict.h"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegrees = 180 / std::numbers::pi;

Json Rows(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(matrix(i, j));
    rows.push_back(row);
  }
  return rows;
}

Json Vector(const Eigen::VectorXd& vector) {
  Json numbers = Json::array();
  for (const double value : vector) numbers.push_back(value);
  return numbers;
}

const char* NameOfShape(TargetShape shape) {
  switch (shape) {
    case TargetShape::kBentBoard:
      return "bent board on a flat plate";
    case TargetShape::kBent:
      return "bent";
    case TargetShape::kFlat:
      break;
  }
  return "flat";
}

Json PlaneJson(const CalibrationResult& result) {
  const Eigen::Vector3d plane = result.rig.shared.segment<3>(kPlaneX);
  Json json = {{"normal", Vector(plane.normalized())},
               {"distance_m", 1 / plane.norm()},
               {"normal_over_distance_per_m", Vector(plane)},
               {"covariance", Rows(result.rig.covariance.block<3, 3>(kPlaneX, kPlaneX))}};
  if (result.reference) {
    json["reference"] = {{"angle_deg", kDegrees * result.reference->angle_rad},
                         {"distance_m", result.reference->reference_distance_m},
                         {"line_rms_m", result.reference->line_rms_m}};
  }
  return json;
}

Json FrameJson(const CalibrationFrameResult& frame) {
  Json json = {{"name", frame.name}, {"used", frame.used}};
  if (frame.used) {
    json["rms_m"] = frame.left_out.rms_m;
    json["predicted_rms_m"] = frame.left_out.predicted_rms_m;
    json["corner_rms_px"] = frame.corner_rms_px;
    const std::string remark = FarOffRemark(frame.left_out);
    if (!remark.empty()) json["remark"] = remark;
  } else {
    json["rms_m"] = nullptr;
    json["predicted_rms_m"] = nullptr;
    json["because"] = frame.because;
  }
  if (frame.hand_eye_position_m) json["hand_eye_position_m"] = *frame.hand_eye_position_m;
  return json;
}

Json LightJson(const FrameLight& light) {
  Json json = {{"findings", LightFindings(light)}, {"not_determined", NotDetermined(light)}};
  if (light.frame_count == 0) return json;
  json["print_over_paper"] = {{"value", light.print_over_paper},
                              {"standard_error", light.print_over_paper_error}};
  json["left_out_rms_dn"] = {{"without_halo", light.even_rms_dn},
                             {"halo_in_lens", light.lens_rms_dn},
                             {"halo_on_board", light.board_rms_dn}};
  json["along_line_correlation"] = light.along_line_correlation;
  json["noise_exponent"] = {{"value", light.noise_exponent},
                            {"standard_error", light.noise_exponent_error}};
  return json;
}

void SetDevices(const CalibrationResult& result, const v1::AssumedDevices& assumed,
                v1::Inspection* inspection) {
  const PlanningRig& rig = result.planning;
  v1::Camera& camera = *inspection->mutable_camera();
  camera.set_columns_px(rig.columns_px);
  camera.set_rows_px(rig.rows_px);
  camera.set_vertical_fov_deg(2 * kDegrees * std::atan(0.5 * rig.rows_px / rig.focal_length_px));
  if (assumed.wavelength_m() > 0) {
    inspection->mutable_laser()->set_wavelength_m(assumed.wavelength_m());
  }
  if (assumed.has_target_material()) {
    *inspection->add_materials()->mutable_material() = assumed.target_material();
  }
  if (!(assumed.pixel_pitch_m() > 0)) return;
  camera.set_pixel_pitch_m(assumed.pixel_pitch_m());
  const double image_distance_m = rig.focal_length_px * assumed.pixel_pitch_m();
  v1::Lens& lens = *inspection->mutable_lens();
  lens.set_focal_length_m(1 / (1 / image_distance_m + 1 / rig.camera_distance_m));
  lens.set_focus_distance_m(rig.camera_distance_m);
  lens.set_f_number(assumed.f_number() > 0 ? assumed.f_number() : 8);
  if (assumed.has_sensor()) {
    *camera.mutable_sensor() = assumed.sensor();
    camera.mutable_sensor()->set_sensor_columns_px(rig.columns_px);
    camera.mutable_sensor()->set_sensor_rows_px(rig.rows_px);
  }
}

}  // namespace

std::string CalibrationJson(const CalibrationResult& result) {
  const TargetCamera camera = CameraOf(result.rig.shared);
  Json json = {{"name", result.name}};
  json["camera"] = {{"fx_px", camera.fx},
                    {"fy_px", camera.fy},
                    {"cx_px", camera.cx},
                    {"cy_px", camera.cy},
                    {"distortion", camera.distortion},
                    {"covariance", Rows(result.rig.covariance.topLeftCorner<9, 9>())}};
  json["laser_plane"] = PlaneJson(result);
  if (result.hand_eye) {
    const HandEye& hand = *result.hand_eye;
    json["hand_eye"] = {{"rotation_vector_rad", Vector(hand.camera_in_flange.head<3>())},
                        {"translation_m", Vector(hand.camera_in_flange.tail<3>())},
                        {"covariance", Rows(hand.covariance)},
                        {"closure_m", hand.closure_m},
                        {"closure_rad", hand.closure_rad}};
  }
  if (result.robot_scale) {
    json["squares_by_robot_over_stated"] = {{"value", result.robot_scale->value},
                                            {"standard_error", result.robot_scale->standard_error}};
  }
  if (result.bend) {
    json["target_bend"] = {{"largest_m", result.bend->largest_m},
                           {"chi_square", result.bend->chi_square}};
  }
  json["target_shape"] = NameOfShape(result.shape);
  json["target_shapes_tried"] = Json::array();
  for (const ShapeTrial& trial : result.shape_trials) {
    json["target_shapes_tried"].push_back({{"shape", NameOfShape(trial.shape)},
                                           {"left_out_rms_m", trial.left_out_rms_m},
                                           {"corner_standard_deviation_px", trial.corner_sd_px}});
  }
  json["corner_standard_deviation_px"] = result.rig.corner_sd_px;
  json["line_standard_deviation_px"] = result.crossing_sd_px;
  json["line_scatter_over_that_of_short_pieces"] = result.rig.line_scale;
  json["clipped_fraction"] = result.clipped_fraction;
  json["frames"] = Json::array();
  for (const CalibrationFrameResult& frame : result.frames) {
    json["frames"].push_back(FrameJson(frame));
  }
  json["real_over_predicted"] = {
      {"value", result.ratio.value}, {"low", result.ratio.low}, {"high", result.ratio.high}};
  json["verdict"] = {{"value", NameOf(VerdictOf(result.ratio, result.UsedFrames()))},
                     {"because", VerdictText(result.ratio, result.UsedFrames())}};
  json["light"] = LightJson(result.light);
  json["warnings"] = result.warnings;
  return json.dump(2) + "\n";
}

v1::Inspection CalibratedInspection(const CalibrationResult& result, const CalibrationSet& set,
                                    const std::string& part_file) {
  const PlanningRig& rig = result.planning;
  v1::Inspection inspection;
  inspection.set_name(result.name);
  inspection.mutable_part()->set_file(part_file.empty() ? "target.stl" : part_file);
  if (part_file.empty()) inspection.mutable_part()->set_unit("m");
  SetDevices(result, set.assumed, &inspection);
  // The calibration is valid for the relative pose of camera and laser.
  inspection.mutable_rig()->set_sensor_mount(v1::Rig::SENSOR_MOUNT_RIGID);
  v1::MeasurementDomain& domain = *inspection.mutable_measurement();
  domain.mutable_camera_distance_m()->set_fixed(rig.camera_distance_m);
  domain.mutable_triangulation_angle_deg()->set_fixed(kDegrees * rig.triangulation_angle_rad);
  v1::Uncertainty& uncertainty = *inspection.mutable_uncertainty();
  uncertainty.mutable_line_detection()->set_standard_deviation_px(result.crossing_sd_px);
  for (Eigen::Index i = 0; i < rig.covariance.rows(); ++i) {
    for (Eigen::Index j = 0; j < rig.covariance.cols(); ++j) {
      uncertainty.mutable_calibration()->add_covariance(rig.covariance(i, j));
    }
  }
  return inspection;
}

std::string TargetStl(const TargetBoard& board) {
  const double x = 0.5 * (board.inner_corners_x + 3) * board.square_m;
  const double y = 0.5 * (board.inner_corners_y + 3) * board.square_m;
  constexpr double kThickness_m = 0.002;
  const auto corner = [&](int i) {
    return std::array<double, 3>{(i & 1) != 0 ? x : -x, (i & 2) != 0 ? y : -y,
                                 (i & 4) != 0 ? 0.0 : -kThickness_m};
  };
  constexpr std::array<std::array<int, 3>, 12> kTriangles = {{{0, 2, 1},
                                                              {1, 2, 3},
                                                              {4, 5, 6},
                                                              {5, 7, 6},
                                                              {0, 1, 4},
                                                              {1, 5, 4},
                                                              {2, 6, 3},
                                                              {3, 6, 7},
                                                              {0, 4, 2},
                                                              {2, 4, 6},
                                                              {1, 3, 5},
                                                              {3, 7, 5}}};
  std::string text = "solid target\n";
  for (const auto& triangle : kTriangles) {
    absl::StrAppendFormat(&text, "facet normal 0 0 0\nouter loop\n");
    for (const int i : triangle) {
      const auto p = corner(i);
      absl::StrAppendFormat(&text, "vertex %.9g %.9g %.9g\n", p[0], p[1], p[2]);
    }
    absl::StrAppendFormat(&text, "endloop\nendfacet\n");
  }
  return text + "endsolid target\n";
}

}  // namespace sightline
