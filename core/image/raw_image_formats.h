// SPDX-License-Identifier: Apache-2.0
// Readers of single formats, for ReadRawImageFile.
#pragma once

#include <cstdio>

#include "core/image/read_raw_image.h"

namespace sightline {

// From the start of `file`. Errors are as of ReadRawImageFile, without the file's name.
// `check_size` is not empty.
absl::StatusOr<RawImageFile> ReadRawPng(std::FILE* file, const ImageSizeCheck& check_size,
                                        const StopCheck& stop);
absl::StatusOr<RawImageFile> ReadRawTiff(std::FILE* file, const ImageSizeCheck& check_size,
                                         const StopCheck& stop);

}  // namespace sightline
