// SPDX-License-Identifier: Apache-2.0
// Readers of single formats, for ReadRawImageFile: tags first, then pixels as they are stored.
#pragma once

#include <cstdio>

#include "core/image/image_tags.h"
#include "core/image/read_raw_image.h"

namespace sightline {

// Reads the tags of the whole file without decoding pixels. The reader of pixels reports missing
// strips. INVALID_ARGUMENT: the file's directory is damaged.
absl::StatusOr<ImageTags> ReadPngTags(std::FILE* file, const StopCheck& stop);
absl::StatusOr<ImageTags> ReadTiffTags(std::FILE* file, const StopCheck& stop);

// Reads pixels as stored, without applying the orientation. Errors as ReadRawImageFile, without the
// file's name. `check_size` is not empty; it is called with the stored size.
absl::StatusOr<RawImageFile> ReadRawPng(std::FILE* file, const ImageSizeCheck& check_size,
                                        const StopCheck& stop);
absl::StatusOr<RawImageFile> ReadRawTiff(std::FILE* file, const ImageSizeCheck& check_size,
                                         const StopCheck& stop);

}  // namespace sightline
