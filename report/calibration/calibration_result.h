// SPDX-License-Identifier: Apache-2.0
// Result of a calibration of a scanner.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/frame_light/frame_light.h"
#include "core/scanner_calibration/hand_eye.h"
#include "core/scanner_calibration/left_out_frames.h"
#include "core/scanner_calibration/planning_rig.h"
#include "core/scanner_calibration/rig_adjustment.h"

namespace sightline {

struct CalibrationFrameResult {
  std::string name;
  bool used = false;
  std::string because;    // if not
  LeftOutFrame left_out;  // if used
  double corner_rms_px = 0;
  std::optional<double> hand_eye_position_m;
};

struct PlaneComparison {
  double angle_rad = 0;                             // between the normals
  double distance_m = 0, reference_distance_m = 0;  // from the camera
  double line_rms_m = 0;  // of the line's points off the target, triangulated with the reference
};

// Prediction error of left-out frames with a target of one shape.
struct ShapeTrial {
  TargetShape shape = TargetShape::kFlat;
  double left_out_rms_m = 0, corner_sd_px = 0;
};

// Fit of a bent target: terms of its shape are estimated with all other parameters.
struct TargetBend {
  double largest_m = 0;   // height of a corner above a plane
  double chi_square = 0;  // of the three terms against 0
};

struct CalibrationResult {
  int UsedFrames() const {
    return static_cast<int>(
        std::count_if(frames.begin(), frames.end(), [](const auto& frame) { return frame.used; }));
  }

  std::string name;
  int columns_px = 0, rows_px = 0;
  TargetBoard board;
  AdjustedRig rig;
  PlanningRig planning;
  std::vector<CalibrationFrameResult> frames;
  ScatterRatio ratio;
  double crossing_sd_px = 0;  // of the line's centre in one row or column, over all used frames
  double clipped_fraction = 0;
  std::optional<HandEye> hand_eye;
  std::optional<RobotScale> robot_scale;
  TargetShape shape = TargetShape::kFlat;
  std::vector<ShapeTrial> shape_trials;  // flat, and others if the target seems to be bent
  std::optional<TargetBend> bend;
  std::optional<PlaneComparison> reference;
  FrameLight light;  // frame_count 0: not measured
  std::vector<std::string> warnings;
};

}  // namespace sightline
