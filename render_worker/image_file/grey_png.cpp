// SPDX-License-Identifier: Apache-2.0
#include "render_worker/image_file/grey_png.h"

#include <png.h>

#include "absl/strings/str_cat.h"

namespace sightline {

absl::StatusOr<std::string> EncodeGreyPng(const Image<uint8_t>& image) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.columns_px);
  png.height = static_cast<png_uint_32>(image.rows_px);
  png.format = PNG_FORMAT_GRAY;
  png_alloc_size_t size = 0;
  std::string bytes;
  bool ok = png_image_write_get_memory_size(png, size, 0, image.values.data(), 0, nullptr) != 0;
  if (ok) {
    bytes.resize(size);
    ok = png_image_write_to_memory(&png, bytes.data(), &size, 0, image.values.data(), 0, nullptr) !=
         0;
  }
  if (!ok) {
    const std::string reason = png.message;
    png_image_free(&png);
    return absl::InternalError(absl::StrCat("cannot encode PNG: ", reason));
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace sightline
