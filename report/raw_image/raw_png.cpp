// SPDX-License-Identifier: Apache-2.0
#include "report/raw_image/raw_png.h"

#include <png.h>

#include <cassert>
#include <csetjmp>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/image/read_raw_image.h"

namespace sightline {
namespace {

void Append(png_structp png, png_bytep bytes, png_size_t count) {
  static_cast<std::string*>(png_get_io_ptr(png))
      ->append(reinterpret_cast<const char*>(bytes), count);
}

void Flush(png_structp) {}

// libpng exits by longjmp on errors, so no object with a destructor may be alive here.
bool Write(png_structp png, png_infop info, const uint8_t* values, png_uint_32 columns,
           png_uint_32 rows, bool colour, const char* description, std::string* file) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_set_write_fn(png, file, Append, Flush);
  png_set_IHDR(png, info, columns, rows, 8, colour ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (*description != '\0') {
    char keyword[] = "Description";
    png_text text = {};
    text.compression = PNG_TEXT_COMPRESSION_NONE;
    text.key = keyword;
    text.text = const_cast<char*>(description);
    png_set_text(png, info, &text, 1);
  }
  // Fast: pictures are looked at once.
  png_set_compression_level(png, 3);
  png_write_info(png, info);
  const size_t stride = size_t{columns} * (colour ? 3 : 1);
  for (png_uint_32 row = 0; row < rows; ++row) png_write_row(png, values + row * stride);
  png_write_end(png, info);
  return true;
}

}  // namespace

absl::StatusOr<RawPng> ReadRawPng(const std::string& file, uint64_t max_pixels) {
  const auto check_size = [&](int columns_px, int rows_px) {
    return uint64_t(columns_px) * uint64_t(rows_px) <= max_pixels
               ? absl::OkStatus()
               : absl::InvalidArgumentError("is too large for a picture");
  };
  absl::StatusOr<RawImageFile> image = ReadRawImageFile(file, check_size);
  if (!image.ok()) {
    return absl::InternalError(absl::StrCat(std::filesystem::path(file).filename().string(),
                                            ": cannot be read as a 16-bit greyscale image"));
  }
  RawPng raw;
  raw.columns_px = image->raw_dn.columns_px;
  raw.rows_px = image->raw_dn.rows_px;
  raw.values_dn = std::move(image->raw_dn.values);
  return raw;
}

absl::StatusOr<std::string> EncodePng(const std::vector<uint8_t>& values, int columns_px,
                                      int rows_px, bool colour, const std::string& description) {
  assert(values.size() == size_t(columns_px) * size_t(rows_px) * (colour ? 3 : 1));
  std::string file;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  const bool written = info != nullptr &&
                       Write(png, info, values.data(), static_cast<png_uint_32>(columns_px),
                             static_cast<png_uint_32>(rows_px), colour, description.c_str(), &file);
  png_destroy_write_struct(&png, &info);
  if (!written) return absl::InternalError("the picture cannot be written as PNG");
  return file;
}

}  // namespace sightline
