// SPDX-License-Identifier: Apache-2.0
#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/image/raw_image_formats.h"

namespace sightline {
namespace {

constexpr png_uint_32 kRowsPerStopCheck = 256;

struct PngHeader {
  png_uint_32 columns = 0, rows = 0;
  int bits = 0, colour_type = 0;
};

// State of one ReadPng call, with the reason if it was refused.
struct PngImage {
  const ImageSizeCheck* check_size = nullptr;
  const StopCheck* stop = nullptr;
  absl::Status refused;
  Image<uint16_t> wide;
  std::vector<uint8_t> narrow;
  std::vector<png_bytep> rows;

  // Makes room for the image, unless it is refused.
  void Begin(const PngHeader& header) {
    if (header.colour_type != PNG_COLOR_TYPE_GRAY) {
      refused = absl::InvalidArgumentError(
          absl::StrCat(header.colour_type == PNG_COLOR_TYPE_GRAY_ALPHA ? "has transparency"
                       : header.colour_type == PNG_COLOR_TYPE_PALETTE  ? "has a palette"
                                                                       : "is a colour image",
                       ", must be greyscale with the numbers as read out (no demosaicing)"));
    } else if (header.bits != 16 && header.bits != 8) {
      refused = absl::InvalidArgumentError(
          absl::StrCat("has ", header.bits, " bits a pixel: record raw numbers in 16-bit files"));
    } else {
      // libpng itself takes no more than a million pixels a side.
      refused = (*check_size)(static_cast<int>(header.columns), static_cast<int>(header.rows));
    }
    if (!refused.ok()) return;
    wide = Image<uint16_t>(static_cast<int>(header.columns), static_cast<int>(header.rows));
    if (header.bits == 8) narrow.resize(wide.values.size());
    for (png_uint_32 row = 0; row < header.rows; ++row) {
      rows.push_back(header.bits == 8
                         ? narrow.data() + static_cast<size_t>(row) * header.columns
                         : reinterpret_cast<png_bytep>(wide.Row(static_cast<int>(row))));
    }
  }
  bool GoesOn() {
    refused = CheckStop(*stop);
    return refused.ok();
  }
};

using Message = std::array<char, 128>;

void KeepMessage(png_structp png, png_const_charp message) {
  Message& kept = *static_cast<Message*>(png_get_error_ptr(png));
  kept = {};
  std::strncpy(kept.data(), message, kept.size() - 1);
  png_longjmp(png, 1);
}

void IgnoreWarning(png_structp, png_const_charp) {}

// libpng leaves by longjmp, so nothing here has a destructor. Rows of 16-bit or 8-bit samples.
bool ReadPng(std::FILE* file, Message* message, PngHeader* header, PngImage* image) {
  png_structp png =
      png_create_read_struct(PNG_LIBPNG_VER_STRING, message, KeepMessage, IgnoreWarning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_read_struct(&png, nullptr, nullptr);
    return false;
  }
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_init_io(png, file);
  // Texts, profiles and the like are compressed: small files could hold any amount of them.
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  // Pixels left over behind the last row are an error, not a warning.
  png_set_benign_errors(png, 0);
  png_read_info(png, info);
  png_get_IHDR(png, info, &header->columns, &header->rows, &header->bits, &header->colour_type,
               nullptr, nullptr, nullptr);
  image->Begin(*header);
  if (image->refused.ok()) {
    if (header->bits == 16 && std::endian::native == std::endian::little) png_set_swap(png);
    const int passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    for (int pass = 0; pass < passes; ++pass) {
      for (png_uint_32 row = 0; row < header->rows; row += kRowsPerStopCheck) {
        if (!image->GoesOn()) {
          png_destroy_read_struct(&png, &info, nullptr);
          return true;
        }
        png_read_rows(png, image->rows.data() + row, nullptr,
                      std::min(kRowsPerStopCheck, header->rows - row));
      }
    }
    png_read_end(png, nullptr);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

}  // namespace

absl::StatusOr<RawImageFile> ReadRawPng(std::FILE* file, const ImageSizeCheck& check_size,
                                        const StopCheck& stop) {
  std::rewind(file);
  PngImage image;
  image.check_size = &check_size;
  image.stop = &stop;
  PngHeader header;
  Message message{};
  const bool ok = ReadPng(file, &message, &header, &image);
  if (!image.refused.ok()) return image.refused;
  if (!ok) {
    return absl::InvalidArgumentError(
        absl::StrCat("is damaged or truncated: ", std::string(message.data())));
  }
  std::copy(image.narrow.begin(), image.narrow.end(), image.wide.values.begin());
  return RawImageFile{std::move(image.wide), header.bits};
}

}  // namespace sightline
