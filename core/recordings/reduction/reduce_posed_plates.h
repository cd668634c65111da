// SPDX-License-Identifier: Apache-2.0
// Recordings of plates in poses (format version 3) as recordings of plates perpendicular to the
// camera (version 1), which the diagnosis takes.
//
// The line of each recording is cut into segments of at most kSegmentPx along it, and each segment
// becomes a recording. Its images are transposed if the line runs along the columns, so that
// it runs along the rows. Every column is shifted by whole pixels, so that the line stays in the
// row in which it is in the middle of the segment. Depth, angles, width and brightness are those of
// the point in the middle (core/plate_line).
//
// Neglected, with its size at the ends of a segment of 128 px, a focal length of 2000 px, and a
// plate tilted by 30 degrees:
// - change along the segment: depth by 1.9 %, which cancels to first order in means along it;
// - change of depth across the line: 0.06 % for a line of 4 px; blur changes by as much of itself;
// - slope of the line within a column: the lens blurs perpendicular to the line, columns cut it at
//   an angle; the blur's width grows by half the slope squared, 0.5 % for 0.1;
// - correlation of speckle between columns where the shift changes.
// tests/render_worker/recordings/reduction_test.cpp compares with exact renderings.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/recordings/recordings.h"

namespace sightline {

inline constexpr int kSegmentPx = 128;
// Rows that a segment has on either side of its line at most.
inline constexpr int kSegmentReachPx = 160;

struct ReducedPlates {
  // format_version 1; `posed` is kept. Recordings have `view` and `part_of_image`; their regions of
  // interest are relative to the principal point, in the order along, across the line.
  RecordingSet set;
  std::vector<Image<uint16_t>> raw_dn;  // one for each recording; empty if none were given
  std::vector<std::string> remarks;     // segments left out and why; exchanged columns and rows
};

// `posed`: format_version 3, as ParseRecordings makes it. `raw_dn`: one image for every recording,
// or none at all. An empty image gives empty segments. INVALID_ARGUMENT: lines run along rows in
// some recordings and along columns in others; focal length, pixel pitch and focus distance do not
// make the focal length in pixels (within 10 %); no segment is left of any recording.
absl::StatusOr<ReducedPlates> ReducePosedPlates(const RecordingSet& posed,
                                                const std::vector<Image<uint16_t>>& raw_dn);

}  // namespace sightline
