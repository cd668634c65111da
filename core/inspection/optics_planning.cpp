// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/optics_planning.h"

#include <algorithm>

#include "core/field_limits/field_checks.h"
#include "core/field_limits/imaging_limits.h"
#include "core/sensor/sensor.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kExposures{2, 2000, ""};
// A rig may have a power of 0, a planned setting may not: it has no line.
constexpr Limits kPlannedLaserPower{0, 100, " W", true};
constexpr Limits kPriorUncertainty{0, 1000, " px", true};
constexpr Limits kWeight{0, 1000, ""};
constexpr Limits kFraction{0, 1, ""};
constexpr Limits kMotionBlur{0, 100, " px", true};
constexpr Limits kCostOfTime{0, 1e6, " px/s"};
constexpr Limits kRealisations{2, 64, ""};
constexpr Limits kFrames{1, 64, ""};
constexpr Limits kRidgeSigma{0.5, 20, " px", true};
constexpr Limits kRidgeScore{0, 1e6, " DN/px^2"};
constexpr Limits kMaxLines{1, 64, ""};
constexpr int kMaxSettingValues = 32;

absl::StatusOr<SettingDomain> ParseSettingDomain(const v1::ParameterDomain& message,
                                                 const std::string& path, const Limits& limits,
                                                 const Checker& check) {
  const int given = message.has_fixed() + !message.values().empty() + !message.ranges().empty();
  if (given != 1) {
    return check.Error(path, absl::StrCat("has ", given == 0 ? "none" : "several",
                                          " of fixed, values, ranges, must have exactly one"));
  }
  SettingDomain domain;
  if (message.has_fixed()) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".fixed", message.fixed(), limits));
    domain.values = {message.fixed()};
    return domain;
  }
  if (message.values_size() > kMaxSettingValues) {
    return check.Error(path + ".values", absl::StrCat("has ", message.values_size(),
                                                      " entries, at most ", kMaxSettingValues));
  }
  for (int i = 0; i < message.values_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat(path, ".values[", i, "]"), message.values(i), limits));
    domain.values.push_back(message.values(i));
  }
  std::sort(domain.values.begin(), domain.values.end());
  domain.values.erase(std::unique(domain.values.begin(), domain.values.end()), domain.values.end());
  if (!domain.values.empty()) return domain;
  if (message.ranges_size() > 1) {
    return check.Error(path + ".ranges",
                       absl::StrCat("has ", message.ranges_size(), " ranges, must have one"));
  }
  domain.min = message.ranges(0).min();
  domain.max = message.ranges(0).max();
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".ranges[0].min", domain.min, limits));
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".ranges[0].max", domain.max, limits));
  if (domain.min > domain.max) {
    return check.Error(path + ".ranges[0]", absl::StrCat("has min ", NumberText(domain.min),
                                                         " above max ", NumberText(domain.max)));
  }
  if (domain.min == domain.max) domain.values = {domain.min};
  return domain;
}

absl::StatusOr<LineDetector> ParseLineDetector(const v1::LineDetector& message,
                                               const Checker& check) {
  const std::string path = "optics.detection";
  LineDetector detector;
  switch (message.method()) {
    case v1::LineDetector::METHOD_UNSPECIFIED:
    case v1::LineDetector::METHOD_CENTRE_OF_GRAVITY:
      break;
    case v1::LineDetector::METHOD_GAUSSIAN_FIT:
      detector.method = LaserLineMethod::kGaussianFit;
      break;
    default:
      return check.Error(path + ".method",
                         "must be METHOD_CENTRE_OF_GRAVITY or "
                         "METHOD_GAUSSIAN_FIT");
  }
  switch (message.channel()) {
    case v1::LineDetector::CHANNEL_UNSPECIFIED:
      break;
    case v1::LineDetector::CHANNEL_RED:
      detector.channel = kRed;
      break;
    case v1::LineDetector::CHANNEL_GREEN:
      detector.channel = kGreen;
      break;
    case v1::LineDetector::CHANNEL_BLUE:
      detector.channel = kBlue;
      break;
    default:
      return check.Error(path + ".channel", "must be CHANNEL_RED, CHANNEL_GREEN or CHANNEL_BLUE");
  }
  if (message.has_ridge_sigma_px()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(path + ".ridge_sigma_px", message.ridge_sigma_px(), kRidgeSigma));
    detector.ridge_sigma_px = message.ridge_sigma_px();
  }
  if (message.has_min_ridge_score_dn()) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(path + ".min_ridge_score_dn", message.min_ridge_score_dn(), kRidgeScore));
    detector.min_ridge_score_dn = message.min_ridge_score_dn();
  }
  if (message.has_max_lines()) detector.max_lines = message.max_lines();
  SIGHTLINE_RETURN_IF_ERROR(check.Range(path + ".max_lines", detector.max_lines, kMaxLines));
  return detector;
}

}  // namespace

std::vector<double> UsualFNumbers() { return {1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22}; }

absl::StatusOr<OpticsPlanning> ParseOpticsPlanning(const v1::OpticsPlanning& message,
                                                   const Lens& lens, const std::string& context) {
  const Checker check(context);
  OpticsPlanning planning;
  const Limits f_numbers{lens.min_f_number.value_or(kLensFNumber.min),
                         lens.max_f_number.value_or(kLensFNumber.max),
                         lens.min_f_number || lens.max_f_number ? ", the lens's range" : ""};
  if (message.f_numbers_size() > kMaxSettingValues) {
    return check.Error("optics.f_numbers", absl::StrCat("has ", message.f_numbers_size(),
                                                        " entries, at most ", kMaxSettingValues));
  }
  for (int i = 0; i < message.f_numbers_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("optics.f_numbers[", i, "]"), message.f_numbers(i), f_numbers));
    planning.f_numbers.push_back(message.f_numbers(i));
  }
  if (planning.f_numbers.empty()) {
    for (const double f_number : UsualFNumbers()) {
      if (f_numbers.Contains(f_number)) planning.f_numbers.push_back(f_number);
    }
    // A lens between two usual ones.
    if (planning.f_numbers.empty()) planning.f_numbers = {lens.f_number};
  }
  std::sort(planning.f_numbers.begin(), planning.f_numbers.end());
  planning.f_numbers.erase(std::unique(planning.f_numbers.begin(), planning.f_numbers.end()),
                           planning.f_numbers.end());
  if (message.has_exposure_time_s()) {
    const double min = message.exposure_time_s().min(), max = message.exposure_time_s().max();
    SIGHTLINE_RETURN_IF_ERROR(check.Range("optics.exposure_time_s.min", min, kExposureTime));
    SIGHTLINE_RETURN_IF_ERROR(check.Range("optics.exposure_time_s.max", max, kExposureTime));
    if (!(min < max)) {
      return check.Error(
          "optics.exposure_time_s",
          absl::StrCat("has min ", NumberText(min), ", must be below max ", NumberText(max)));
    }
    planning.exposure_time_s = {min, max};
  }
  if (message.has_exposures()) planning.exposures = message.exposures();
  SIGHTLINE_RETURN_IF_ERROR(check.Range("optics.exposures", planning.exposures, kExposures));
  planning.every_exposure = message.every_exposure();
  if (message.has_focus_distance_m()) {
    const Limits nearest{
        std::max(lens.min_focus_distance_m.value_or(0), 1.01 * lens.focal_length_m), 1000,
        " m, what the lens focuses on"};
    SIGHTLINE_ASSIGN_OR_RETURN(
        planning.focus_distance_m,
        ParseSettingDomain(message.focus_distance_m(), "optics.focus_distance_m", nearest, check));
  }
  if (message.has_laser_power_w()) {
    SIGHTLINE_ASSIGN_OR_RETURN(planning.laser_power_w,
                               ParseSettingDomain(message.laser_power_w(), "optics.laser_power_w",
                                                  kPlannedLaserPower, check));
  }
  planning.sensor_tilt = message.sensor_tilt();
  planning.two_exposures = message.two_exposures();
  const auto number = [&](const char* name, bool given, double value, const Limits& limits,
                          double* to) {
    if (!given) return absl::OkStatus();
    *to = value;
    return check.Range(absl::StrCat("optics.", name), value, limits);
  };
  SIGHTLINE_RETURN_IF_ERROR(number("prior_uncertainty_px", message.has_prior_uncertainty_px(),
                                   message.prior_uncertainty_px(), kPriorUncertainty,
                                   &planning.prior_uncertainty_px));
  SIGHTLINE_RETURN_IF_ERROR(number("false_line_weight", message.has_false_line_weight(),
                                   message.false_line_weight(), kWeight,
                                   &planning.false_line_weight));
  SIGHTLINE_RETURN_IF_ERROR(number("max_clipped_fraction", message.has_max_clipped_fraction(),
                                   message.max_clipped_fraction(), kFraction,
                                   &planning.max_clipped_fraction));
  SIGHTLINE_RETURN_IF_ERROR(number("max_motion_blur_px", message.has_max_motion_blur_px(),
                                   message.max_motion_blur_px(), kMotionBlur,
                                   &planning.max_motion_blur_px));
  SIGHTLINE_RETURN_IF_ERROR(number("cost_px_per_s", message.has_cost_px_per_s(),
                                   message.cost_px_per_s(), kCostOfTime, &planning.cost_px_per_s));
  if (message.has_realisations()) planning.realisations = message.realisations();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("optics.realisations", planning.realisations, kRealisations));
  if (message.has_frames_per_scan()) planning.frames_per_scan = message.frames_per_scan();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("optics.frames_per_scan", planning.frames_per_scan, kFrames));
  SIGHTLINE_ASSIGN_OR_RETURN(planning.detector, ParseLineDetector(message.detection(), check));
  return planning;
}

}  // namespace sightline
