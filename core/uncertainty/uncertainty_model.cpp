// SPDX-License-Identifier: Apache-2.0
#include "core/uncertainty/uncertainty_model.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/field_limits/field_checks.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kDetection{0, 100, " px", true};
constexpr Limits kPrior{0, 1, " m", true};
constexpr Limits kResolution{1e-5, 1, " m"};
constexpr Limits kDistance{0, 100, " m", true};
constexpr Limits kAngle{0, 90, " deg"};
constexpr Limits kExposure{0, 1000, " s", true};
constexpr int kMaxTableEntries = 1 << 16;
constexpr int kCalibrationVariables = kTriangulationVariables - kCameraAlpha;

// Index of the entry below `x` and the weight of the next one.
struct InterpolationInterval {
  size_t below;
  double weight;
};
InterpolationInterval IntervalOf(const std::vector<double>& axis, double x) {
  const auto above = std::upper_bound(axis.begin(), axis.end(), x);
  if (above == axis.begin()) return {0, 0};
  const auto below = static_cast<size_t>(above - axis.begin()) - 1;
  if (above == axis.end()) return {below, 0};
  return {below, (x - axis[below]) / (axis[below + 1] - axis[below])};
}

template <typename Values>
absl::Status CheckAxis(const Checker& check, const std::string& path, const Values& values,
                       const Limits& limits) {
  for (int i = 0; i < values.size(); ++i) {
    const std::string field = absl::StrCat(path, "[", i, "]");
    SIGHTLINE_RETURN_IF_ERROR(check.Range(field, values[i], limits));
    if (i > 0 && values[i] <= values[i - 1]) {
      return check.Error(field, absl::StrCat("is ", NumberText(values[i]), ", must be above ",
                                             NumberText(values[i - 1]), " before it"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<LineDetectionNoise> ParseTable(const v1::LineDetection& message,
                                              const Checker& check) {
  const std::string path = "uncertainty.line_detection.table";
  const v1::LineDetection::Table& table = message.table();
  if (table.distances_m().empty()) return check.Error(path + ".distances_m", "is missing");
  if (table.incidence_angles_deg().empty()) {
    return check.Error(path + ".incidence_angles_deg", "is missing");
  }
  SIGHTLINE_RETURN_IF_ERROR(
      CheckAxis(check, path + ".distances_m", table.distances_m(), kDistance));
  SIGHTLINE_RETURN_IF_ERROR(
      CheckAxis(check, path + ".incidence_angles_deg", table.incidence_angles_deg(), kAngle));
  SIGHTLINE_RETURN_IF_ERROR(
      CheckAxis(check, path + ".exposure_times_s", table.exposure_times_s(), kExposure));
  const int64_t exposures = std::max(1, table.exposure_times_s_size());
  const int64_t page = int64_t{table.distances_m_size()} * table.incidence_angles_deg_size();
  const std::string values = path + ".standard_deviations_px";
  if (page * exposures > kMaxTableEntries) {
    return check.Error(values, absl::StrCat("would have ", page * exposures, " entries, at most ",
                                            kMaxTableEntries));
  }
  if (table.standard_deviations_px_size() != page * exposures) {
    return check.Error(
        values, absl::StrCat("has ", table.standard_deviations_px_size(), " entries, must have ",
                             page * exposures, " (exposures x distances x angles)"));
  }
  for (int i = 0; i < table.standard_deviations_px_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat(values, "[", i, "]"),
                                          table.standard_deviations_px(i), kDetection));
  }
  const std::vector<double> times(table.exposure_times_s().begin(), table.exposure_times_s().end());
  InterpolationInterval exposure{0, 0};
  if (message.has_exposure_time_s()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range("uncertainty.line_detection.exposure_time_s",
                                          message.exposure_time_s(), kExposure));
    if (!times.empty()) exposure = IntervalOf(times, message.exposure_time_s());
  }
  LineDetectionNoise noise;
  noise.distances_m.assign(table.distances_m().begin(), table.distances_m().end());
  noise.incidence_angles_rad.clear();
  for (const double angle_deg : table.incidence_angles_deg()) {
    noise.incidence_angles_rad.push_back(Radians(angle_deg));
  }
  noise.standard_deviations_px.clear();
  for (int64_t i = 0; i < page; ++i) {
    const auto entry = [&](size_t e) {
      return table.standard_deviations_px(static_cast<int>(static_cast<int64_t>(e) * page + i));
    };
    double value = entry(exposure.below);
    if (exposure.weight > 0) value += exposure.weight * (entry(exposure.below + 1) - value);
    noise.standard_deviations_px.push_back(value);
  }
  return noise;
}

absl::StatusOr<TriangulationCovariance> ParseCalibration(const v1::Calibration& message,
                                                         const std::string& context) {
  const Checker check(context);
  const std::string path = "uncertainty.calibration";
  TriangulationCovariance covariance = TriangulationCovariance::Zero();
  const bool by_deviations = message.has_camera_rotation_deg() || message.has_camera_position_m() ||
                             message.has_laser_rotation_deg() || message.has_laser_position_m() ||
                             message.has_focal_length_px() || message.has_principal_point_px();
  if (!message.covariance().empty()) {
    if (by_deviations) {
      return check.Error(path + ".covariance", "cannot be given with standard deviations");
    }
    constexpr int kEntries = kCalibrationVariables * kCalibrationVariables;
    if (message.covariance_size() != kEntries) {
      return check.Error(path + ".covariance", absl::StrCat("has ", message.covariance_size(),
                                                            " entries, must have ", kEntries));
    }
    for (int i = 0; i < kEntries; ++i) {
      covariance(kCameraAlpha + i / kCalibrationVariables,
                 kCameraAlpha + i % kCalibrationVariables) = message.covariance(i);
    }
    absl::Status status = CheckTriangulationCovariance(covariance, path + ".covariance");
    if (!status.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(context.empty() ? "" : context + ": ", status.message()));
    }
    return covariance;
  }
  const auto set = [&](const char* name, double value, const Limits& limits, double unit,
                       std::initializer_list<int> variables) -> absl::Status {
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat(path, ".", name), value, limits));
    for (const int v : variables) covariance(v, v) = (value * unit) * (value * unit);
    return absl::OkStatus();
  };
  const double degree = Radians(1);
  SIGHTLINE_RETURN_IF_ERROR(set("camera_rotation_deg", message.camera_rotation_deg(),
                                {0, 10, " deg"}, degree,
                                {kCameraAlpha, kCameraBeta, kCameraGamma}));
  SIGHTLINE_RETURN_IF_ERROR(set("camera_position_m", message.camera_position_m(), {0, 0.1, " m"}, 1,
                                {kCameraX, kCameraY, kCameraZ}));
  // The thesis has a cone of this half angle: each of two orthogonal tilts has 1/sqrt(2) of it.
  SIGHTLINE_RETURN_IF_ERROR(set("laser_rotation_deg", message.laser_rotation_deg(), {0, 10, " deg"},
                                degree * std::sqrt(0.5), {kSheetTiltX, kSheetTiltZ}));
  SIGHTLINE_RETURN_IF_ERROR(
      set("laser_position_m", message.laser_position_m(), {0, 0.1, " m"}, 1, {kSheetOffset}));
  SIGHTLINE_RETURN_IF_ERROR(
      set("focal_length_px", message.focal_length_px(), {0, 1000, " px"}, 1, {kFocalLengthError}));
  SIGHTLINE_RETURN_IF_ERROR(set("principal_point_px", message.principal_point_px(),
                                {0, 1000, " px"}, 1, {kPrincipalX, kPrincipalY}));
  return covariance;
}

absl::Status ParseRegistration(const v1::Uncertainty& message, const Checker& check,
                               UncertaintyModel* model) {
  switch (message.registration()) {
    case v1::Uncertainty::BEST_FIT:
      model->registration = RegistrationMethod::kBestFit;
      break;
    case v1::Uncertainty::DATUM_FEATURES:
      model->registration = RegistrationMethod::kDatumFeatures;
      break;
    case v1::Uncertainty::KNOWN_POSES:
      model->registration = RegistrationMethod::kKnownPoses;
      break;
    default:
      break;
  }
  const bool known = model->registration == RegistrationMethod::kKnownPoses;
  if (message.has_registration_position_m() != known ||
      message.has_registration_angle_deg() != known) {
    const bool position = message.has_registration_position_m();
    if (!known) {
      return check.Error(
          position ? "uncertainty.registration_position_m" : "uncertainty.registration_angle_deg",
          "needs uncertainty.registration KNOWN_POSES");
    }
    return check.Error(
        position ? "uncertainty.registration_angle_deg" : "uncertainty.registration_position_m",
        "is missing: uncertainty.registration KNOWN_POSES needs it");
  }
  if (!known) return absl::OkStatus();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("uncertainty.registration_position_m",
                                        message.registration_position_m(), {0, 0.1, " m"}));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("uncertainty.registration_angle_deg",
                                        message.registration_angle_deg(), {0, 10, " deg"}));
  model->registration_position_m = message.registration_position_m();
  model->registration_angle_rad = Radians(message.registration_angle_deg());
  return absl::OkStatus();
}

}  // namespace

TriangulationCovariance CalibrationOnSite() {
  return MakeTriangulationCovariance({.camera_rotation_rad = Radians(0.001),
                                      .camera_position_m = 0.01e-3,
                                      .laser_tilt_rad = Radians(0.001) * std::sqrt(0.5),
                                      .laser_offset_m = 0.01e-3,
                                      .focal_length_px = 0.2,
                                      .principal_point_px = 0.1});
}

double LineDetectionNoise::At(double distance_m, double incidence_angle_rad) const {
  if (IsConstant()) return standard_deviations_px[0];
  const InterpolationInterval d = IntervalOf(distances_m, distance_m);
  const InterpolationInterval a = IntervalOf(incidence_angles_rad, incidence_angle_rad);
  const size_t angles = incidence_angles_rad.size();
  const auto along_angle = [&](size_t row) {
    const double value = standard_deviations_px[row * angles + a.below];
    if (a.weight == 0) return value;
    return value + a.weight * (standard_deviations_px[row * angles + a.below + 1] - value);
  };
  const double value = along_angle(d.below);
  return d.weight == 0 ? value : value + d.weight * (along_angle(d.below + 1) - value);
}

TriangulationCovariance DetectionCovariance(const UncertaintyModel& model, const SensorPose& camera,
                                            const Eigen::Vector3d& position_m,
                                            const Eigen::Vector3d& normal) {
  const Eigen::Vector3d view = position_m - camera.origin_m;
  const double cosine = std::clamp(-view.normalized().dot(normal), -1.0, 1.0);
  const double noise_px = model.detection.At(view.norm(), std::acos(cosine));
  TriangulationCovariance covariance = TriangulationCovariance::Zero();
  covariance(kImageX, kImageX) = covariance(kImageY, kImageY) = noise_px * noise_px;
  return covariance;
}

absl::StatusOr<UncertaintyModel> ParseUncertainty(const v1::Uncertainty& message,
                                                  const std::string& context) {
  const Checker check(context);
  UncertaintyModel model;
  const v1::LineDetection& detection = message.line_detection();
  if (detection.has_table()) {
    if (detection.has_standard_deviation_px()) {
      return check.Error("uncertainty.line_detection",
                         "has standard_deviation_px and table, must have one of them");
    }
    SIGHTLINE_ASSIGN_OR_RETURN(model.detection, ParseTable(detection, check));
  } else {
    if (detection.has_exposure_time_s()) {
      return check.Error("uncertainty.line_detection.exposure_time_s", "needs a table");
    }
    if (detection.has_standard_deviation_px()) {
      model.detection.standard_deviations_px = {detection.standard_deviation_px()};
    }
    SIGHTLINE_RETURN_IF_ERROR(check.Range("uncertainty.line_detection.standard_deviation_px",
                                          model.detection.standard_deviations_px[0], kDetection));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(model.calibration, ParseCalibration(message.calibration(), context));
  if (message.has_prior_standard_deviation_m()) {
    model.prior_standard_deviation_m = message.prior_standard_deviation_m();
  }
  SIGHTLINE_RETURN_IF_ERROR(check.Range("uncertainty.prior_standard_deviation_m",
                                        model.prior_standard_deviation_m, kPrior));
  if (message.has_resolution_m()) model.resolution_m = message.resolution_m();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("uncertainty.resolution_m", model.resolution_m, kResolution));
  SIGHTLINE_RETURN_IF_ERROR(ParseRegistration(message, check, &model));
  return model;
}

v1::Uncertainty UncertaintyToProto(const UncertaintyModel& model) {
  v1::Uncertainty message;
  v1::LineDetection& detection = *message.mutable_line_detection();
  if (model.detection.IsConstant()) {
    detection.set_standard_deviation_px(model.detection.standard_deviations_px[0]);
  } else {
    v1::LineDetection::Table& table = *detection.mutable_table();
    for (const double d : model.detection.distances_m) table.add_distances_m(d);
    for (const double a : model.detection.incidence_angles_rad) {
      table.add_incidence_angles_deg(Degrees(a));
    }
    for (const double u : model.detection.standard_deviations_px) {
      table.add_standard_deviations_px(u);
    }
  }
  if (model.HasCalibrationErrors()) {
    for (int i = kCameraAlpha; i < kTriangulationVariables; ++i) {
      for (int j = kCameraAlpha; j < kTriangulationVariables; ++j) {
        message.mutable_calibration()->add_covariance(model.calibration(i, j));
      }
    }
  }
  message.set_prior_standard_deviation_m(model.prior_standard_deviation_m);
  message.set_resolution_m(model.resolution_m);
  return message;
}

}  // namespace sightline
