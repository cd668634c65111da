// SPDX-License-Identifier: Apache-2.0
// Raw numbers of cameras from image files: greyscale PNG (libpng) and TIFF (libtiff).
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/status/stop_check.h"

namespace sightline {

// Pixels per side of any raw image.
inline constexpr int kMaxImageSide_px = 1 << 16;

// Checks the size that the header of an image claims, before memory is allocated. An error message
// is put behind the path. Empty: at most kMaxImageSide_px per side.
using ImageSizeCheck = std::function<absl::Status(int columns_px, int rows_px)>;

struct RawImageFile {
  Image<uint16_t> raw_dn;
  int file_bits = 16;   // 8 or 16 a pixel
  int orientation = 1;  // orientation applied to `raw_dn`, 1 to 8; 1: as stored
};

// The content determines the type, not the name. Numbers are not converted; an orientation (TIFF,
// Exif, XMP) is applied, so that row 0 is the top row. NOT_FOUND: no such file. INVALID_ARGUMENT
// names the file and the reason: no regular file, a JPEG or another type, colour, palette or
// transparency, not 8 or 16 bits a pixel without sign, white stored as 0, lossy compression, more
// than one image, another tag that changes the pixels, a size that is not allowed, bytes left over,
// truncated or damaged. `stop` ends it early. `check_size` is called with the size of the image
// after its orientation was applied.
absl::StatusOr<RawImageFile> ReadRawImageFile(const std::string& path,
                                              const ImageSizeCheck& check_size = {},
                                              const StopCheck& stop = {});

// The numbers alone.
absl::StatusOr<Image<uint16_t>> ReadRawImage(const std::string& path);

}  // namespace sightline
