// SPDX-License-Identifier: Apache-2.0
// Section `optics` of an inspection: the choice of camera and laser settings
// (v1::OpticsPlanning).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/laser_line/detect_laser_line.h"
#include "core/rig/rig.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// Detector of the laser line; unset values are derived from the image (see v1::LineDetector).
struct LineDetector {
  LaserLineMethod method = LaserLineMethod::kStegerCentreOfGravity;
  std::optional<int> channel;  // kRed, kGreen, kBlue
  std::optional<double> ridge_sigma_px;
  std::optional<double> min_ridge_score_dn;
  int max_lines = 1;
};

// A setting that may be varied: a list of values, or a range with min < max.
struct SettingDomain {
  std::vector<double> values;
  double min = 0, max = 0;

  bool is_range() const { return values.empty(); }
};

struct OpticsPlanning {
  std::vector<double> f_numbers;  // ascending, at least one, all within the lens's
  // Exposure times at the smallest f-number; unset: derived from the light.
  struct Interval {
    double min, max;
  };
  std::optional<Interval> exposure_time_s;
  int exposures = 300;
  bool every_exposure = false;
  std::optional<SettingDomain> focus_distance_m;  // unset: as the inspection has it
  std::optional<SettingDomain> laser_power_w;
  bool sensor_tilt = false;
  bool two_exposures = false;
  double prior_uncertainty_px = 3;
  double false_line_weight = 0;
  double max_clipped_fraction = 0.1;
  double max_motion_blur_px = 0.5;
  double cost_px_per_s = 0;
  int realisations = 4;
  int frames_per_scan = 3;
  LineDetector detector;
};

// The f-numbers of the thesis, section 6.4.2: {1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22}.
std::vector<double> UsualFNumbers();

// `lens`: lens of the inspection. INVALID_ARGUMENT names context, field, value and allowed range:
// an f-number or focus distance outside the lens's range, an empty interval, ...
absl::StatusOr<OpticsPlanning> ParseOpticsPlanning(const v1::OpticsPlanning& message,
                                                   const Lens& lens, const std::string& context);

}  // namespace sightline
