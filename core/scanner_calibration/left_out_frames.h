// SPDX-License-Identifier: Apache-2.0
// Cross-validation: how well a calibration predicts a left-out frame.
//
// Camera and laser plane are adjusted without the frame. Its line is triangulated with them and the
// distances of the points from the target, whose pose its corners give, are compared with the
// prediction of the covariances (first-order propagation): those of camera and plane, of the pose,
// and the scatter of the line's samples.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/scanner_calibration/rig_adjustment.h"

namespace sightline {

struct LeftOutFrame {
  std::vector<double> along_px;                    // samples of the line
  std::vector<double> distance_m, predicted_sd_m;  // from the target, per sample
  double rms_m = 0, predicted_rms_m = 0;
};

absl::StatusOr<LeftOutFrame> PredictLeftOut(const TargetBoard& board,
                                            const std::vector<CalibrationFrame>& frames,
                                            size_t left_out, const CameraPrior& prior,
                                            TargetShape shape);

// Ratio of real to predicted scatter over all frames, root mean square over root mean square, with
// a 95 % interval by resampling the frames (bootstrap, 2000 times, fixed seed).
struct ScatterRatio {
  double value = 0, low = 0, high = 0;
};
ScatterRatio RealOverPredicted(const std::vector<LeftOutFrame>& frames);

}  // namespace sightline
