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

// Cuts the surroundings of the lines out of the frames in use, in pieces of at most 128 px along
// the line. Pieces have 60 px on each side of the line, nothing but light squares or the plate
// around the board, and beside the line neither clipped pixels nor sides that are half or twice as
// bright as usual in the frame: those show a part before the plate, or light that it reflects.
// Stated are the camera and laser plane of `result`, poses, bits, pixel pitch and wavelength of
// `set.assumed`, and how far the lines are from their predicted places. All else of the light is
// unknown. INVALID_ARGUMENT: `set.assumed` has no wavelength, or nothing is left. Errors of reading
// a frame.
absl::StatusOr<RecordedLines> RecordedLinesOf(const CalibrationSet& set,
                                              const CalibrationResult& result);

}  // namespace sightline
