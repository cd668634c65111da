// Image files of recordings, and what their form alone says against them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/recordings/recordings.h"

namespace sightline {

// Reads files that are no PNG.
using RawImageReader = std::function<absl::StatusOr<Image<uint16_t>>(const std::string& path)>;

// 16-bit greyscale PNG (8 bits if the sensor has no more). NOT_FOUND: no such file.
// INVALID_ARGUMENT: a JPEG or another type by its content, colour or palette, transparent, 8 bits
// where `bit_depth_bit` is more, damaged. `read_other`: for TIFF; empty: TIFF is refused.
absl::StatusOr<Image<uint16_t>> LoadRawImage(const std::string& path, int bit_depth_bit,
                                             const RawImageReader& read_other = {});

struct LoadedImages {
  // One for every recording, in the same order; empty if it cannot be used.
  std::vector<Image<uint16_t>> raw_dn;
  std::vector<std::string> errors;  // name file, field and reason
  // Numbers of all images fit into 8 bits and the files have no more, though the camera has.
  bool eight_bit_files = false;
};

// One image for every recording, from `paths` in the same order; size as the region of interest
// says.
LoadedImages LoadRecordedImages(const RecordingSet& set, const std::vector<std::string>& paths,
                                const RawImageReader& read_other);

}  // namespace sightline
