// SPDX-License-Identifier: Apache-2.0
#include "core/image/write_raw_png.h"

#include <png.h>

#include <csetjmp>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

void Append(png_structp png, png_bytep data, png_size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<char*>(data), size);
}

void Flush(png_structp) {}

void KeepReason(png_structp png, png_const_charp reason) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = reason;
  png_longjmp(png, 1);
}

void Ignore(png_structp, png_const_charp) {}

// The pixels row by row, in 16 bits with the high byte first.
std::vector<png_byte> BytesOf(const Image<uint16_t>& raw_dn, int file_bits) {
  std::vector<png_byte> bytes;
  bytes.reserve(raw_dn.values.size() * static_cast<size_t>(file_bits / 8));
  for (const uint16_t value : raw_dn.values) {
    if (file_bits == 16) bytes.push_back(static_cast<png_byte>(value >> 8));
    bytes.push_back(static_cast<png_byte>(value & 0xff));
  }
  return bytes;
}

}  // namespace

absl::StatusOr<std::string> EncodeRawPng(const Image<uint16_t>& raw_dn, int file_bits) {
  // Everything with a destructor is made before setjmp, which skips none.
  std::vector<png_byte> bytes = BytesOf(raw_dn, file_bits);
  std::string file, reason;
  const size_t row_bytes =
      static_cast<size_t>(raw_dn.columns_px) * static_cast<size_t>(file_bits / 8);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &reason, KeepReason, Ignore);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_write_struct(&png, nullptr);
    return absl::InternalError("cannot encode PNG: out of memory");
  }
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return absl::InternalError(absl::StrCat("cannot encode PNG: ", reason));
  }
  png_set_write_fn(png, &file, Append, Flush);
  png_set_IHDR(png, info, static_cast<png_uint_32>(raw_dn.columns_px),
               static_cast<png_uint_32>(raw_dn.rows_px), file_bits, PNG_COLOR_TYPE_GRAY,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  for (int row = 0; row < raw_dn.rows_px; ++row) {
    png_write_row(png, bytes.data() + static_cast<size_t>(row) * row_bytes);
  }
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return file;
}

}  // namespace sightline
