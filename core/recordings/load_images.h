// SPDX-License-Identifier: Apache-2.0
// Image files of recordings, and errors of their form.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/image/read_raw_image.h"
#include "core/recordings/recordings.h"
#include "core/status/stop_check.h"

namespace sightline {

// As ReadRawImageFile. INVALID_ARGUMENT also for 8 bits where `bit_depth_bit` is more.
absl::StatusOr<Image<uint16_t>> LoadRawImage(const std::string& path, int bit_depth_bit,
                                             const ImageSizeCheck& check_size = {},
                                             const StopCheck& stop = {});

struct LoadedImages {
  // One for every recording, in the same order; empty if it cannot be used.
  std::vector<Image<uint16_t>> raw_dn;
  std::vector<std::string> errors;  // name file, field and reason
  // True if all images have 8 bits, in numbers and files, although the camera has more.
  bool eight_bit_files = false;
  std::vector<std::string> remarks;  // tags of files that were obeyed, one line each kind
};

// One image for every recording, from `paths` in the same order; a file whose header claims another
// size than the region of interest is not read. INVALID_ARGUMENT: regions of more than 16 GiB
// together; or what `stop` says.
absl::StatusOr<LoadedImages> LoadRecordedImages(const RecordingSet& set,
                                                const std::vector<std::string>& paths,
                                                const StopCheck& stop = {});

}  // namespace sightline
