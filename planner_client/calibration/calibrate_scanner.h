// SPDX-License-Identifier: Apache-2.0
// Calibrates a scanner: corners, lines, bundle adjustment, rejection of frames, hand-eye pose.
#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "core/calibration_set/calibration_set.h"
#include "report/calibration/calibration_result.h"

namespace sightline {

// Frames that do not fit are left out with a reason: no board, no line, a view seen before, corner
// residuals above three times those of the median frame, or a line that leaves the plane of the
// others by more than four times the median frame's distance. A given camera is rejected with a
// warning if its corner residuals exceed 1 px and twice those of an estimated camera. A board that
// seems bent is tried in three shapes; the one that best predicts left-out frames is used. The
// squares are compared with the robot's movements, and a given laser plane with the lines.
// INVALID_ARGUMENT if fewer than four frames are left, images differ in size, or poses do not fit
// the frames; the message names the mistake that would explain it. Other errors as FindTargets.
// `progress` is called at the start of every phase with the fraction of the work done before it, in
// [0, 1], and the name of the phase.
using CalibrationProgress = std::function<void(double fraction, const std::string& phase)>;
absl::StatusOr<CalibrationResult> CalibrateScanner(const CalibrationSet& set,
                                                   const CalibrationProgress& progress);

}  // namespace sightline
