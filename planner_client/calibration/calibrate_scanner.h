// SPDX-License-Identifier: Apache-2.0
// From a calibration set to the scanner: corners, lines, adjustment, frames left out, hand-eye.
#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "core/calibration_set/calibration_set.h"
#include "report/calibration/calibration_result.h"

namespace sightline {

// Frames that do not fit are left out and say why: no board, no line, the view of an earlier frame,
// corners that are off three times as far as in the median frame, or a line that is off the plane
// of the others four times as far as that of the median frame. A given camera with which corners
// are off more than 1 px and more than twice as far as with an estimated one is not used, which a
// warning says. A board that seems to be bent is tried in three shapes; the one that best predicts
// left-out frames is used. Its squares are compared with the robot's movements, a given laser plane
// with the lines. INVALID_ARGUMENT: fewer than four frames are left, images differ in size, or the
// poses do not fit the frames; the message says which mistake would explain it. Others as
// FindTargets. `progress` is called at the start of every phase with the fraction of the work done
// before it, in [0, 1], and the phase in words.
using CalibrationProgress = std::function<void(double fraction, const std::string& phase)>;
absl::StatusOr<CalibrationResult> CalibrateScanner(const CalibrationSet& set,
                                                   const CalibrationProgress& progress);

}  // namespace sightline
