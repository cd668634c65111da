// SPDX-License-Identifier: Apache-2.0
// The lines of a calibration's frames as recordings of plates in poses (recordings.json, format
// version 3), for sightline diagnose.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/calibration_set/calibration_set.h"
#include "report/calibration/calibration_result.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

struct RecordedLines {
  v1::Recordings recordings;
  std::vector<std::pair<std::string, std::string>> images;  // file in the folder, bytes of a PNG
  int left_out_px = 0, line_px = 0;                         // rows or columns along the lines
};

// Cuts crops around the lines out of the used frames, at most 128 px long along the line. A crop
// has 60 px on each side of the line and shows only light squares or the plate around the board.
// Crops with clipped pixels beside the line, or with sides half or twice as bright as usual in the
// frame, are skipped: those show an object in front of the plate or reflected light. The recordings
// state the camera and laser plane of `result`, poses, and bits, pixel pitch and wavelength of
// `set.assumed`, and the distance of the lines from their predicted positions. The rest of the
// light model is unknown. INVALID_ARGUMENT if `set.assumed` has no wavelength or no crop is left.
// Errors of reading a frame.
absl::StatusOr<RecordedLines> RecordedLinesOf(const CalibrationSet& set,
                                              const CalibrationResult& result);

}  // namespace sightline
