// SPDX-License-Identifier: Apache-2.0
// Reads pixels of TIFF by libtiff, strip by strip; tiff_tags.cpp reads the tags. Checks that every
// strip has all its bytes: readers for pictures fill missing pixels with zeros, which would
// look like dark ones.
#include <tiffio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstring>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/image/raw_image_formats.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Largest single allocation by libtiff: lists of strips, and one compressed strip.
constexpr tmsize_t kMaxLibraryBytes = tmsize_t{1} << 30;
// A tile may be larger than the image.
constexpr uint64_t kMaxTileBytes = uint64_t{1} << 28;

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using Tiff = std::unique_ptr<TIFF, CloseTiff>;

int KeepFirst(TIFF*, void* context, const char*, const char* format, va_list arguments) {
  auto& message = *static_cast<std::string*>(context);
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  if (message.empty()) message = text.data();
  return 1;
}

int Ignore(TIFF*, void*, const char*, const char*, va_list) { return 1; }

// `message` must outlive the result.
Tiff Open(std::FILE* file, std::string* message) {
  const int descriptor = dup(fileno(file));
  if (descriptor < 0) return nullptr;
  lseek(descriptor, 0, SEEK_SET);
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, kMaxLibraryBytes);
  TIFFOpenOptionsSetErrorHandlerExtR(options, KeepFirst, message);
  TIFFOpenOptionsSetWarningHandlerExtR(options, Ignore, nullptr);
  // Not memory-mapped, so that a file that shrinks meanwhile causes an error, not a signal.
  Tiff tiff(TIFFFdOpenExt(descriptor, "image", "rm", options));
  TIFFOpenOptionsFree(options);
  if (tiff == nullptr) close(descriptor);
  return tiff;
}

absl::Status Damaged(const std::string& reason) {
  return absl::InvalidArgumentError(absl::StrCat("is damaged or truncated: ", reason));
}

bool IsLossless(uint16_t compression) {
  switch (compression) {
    case COMPRESSION_NONE:
    case COMPRESSION_LZW:
    case COMPRESSION_PACKBITS:
    case COMPRESSION_ADOBE_DEFLATE:
    case COMPRESSION_DEFLATE:
    case COMPRESSION_LZMA:
    case COMPRESSION_ZSTD:
      return true;
    default:
      return false;
  }
}

struct TiffHeader {
  uint32_t columns = 0, rows = 0;
  uint16_t bits = 1;
};

absl::Status ReadHeader(TIFF* tiff, TiffHeader* header) {
  uint16_t samples = 1, format = SAMPLEFORMAT_UINT, photometric = PHOTOMETRIC_MINISBLACK,
           compression = COMPRESSION_NONE;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &header->bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &format);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &compression);
  const bool has_photometric = TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &photometric) == 1;
  if (TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &header->columns) != 1 ||
      TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &header->rows) != 1 || header->columns == 0 ||
      header->rows == 0) {
    return Damaged("it does not say how large it is");
  }
  if (samples != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("has ", samples,
                     " channels, must be greyscale with the numbers as read out (no "
                     "demosaicing)"));
  }
  if (photometric == PHOTOMETRIC_PALETTE) {
    return absl::InvalidArgumentError("has a palette, must be greyscale");
  }
  if (photometric == PHOTOMETRIC_MINISWHITE) {
    return absl::InvalidArgumentError(
        "stores white as 0, must store numbers as read out (black as 0)");
  }
  if (!has_photometric) {
    return absl::InvalidArgumentError(
        "does not say whether 0 is black (PhotometricInterpretation is missing)");
  }
  if (photometric != PHOTOMETRIC_MINISBLACK && photometric != PHOTOMETRIC_CFA) {
    return absl::InvalidArgumentError(absl::StrCat("has PhotometricInterpretation ", photometric,
                                                   ", must be 1 (greyscale, 0 is black)"));
  }
  if (format != SAMPLEFORMAT_UINT && format != SAMPLEFORMAT_VOID) {
    return absl::InvalidArgumentError(
        "has numbers with sign or floating point, must have whole numbers without sign");
  }
  if (header->bits != 8 && header->bits != 16) {
    return absl::InvalidArgumentError(
        absl::StrCat("has ", header->bits, " bits a pixel: record raw numbers in 16-bit files"));
  }
  if (!IsLossless(compression)) {
    return absl::InvalidArgumentError(
        absl::StrCat("has compression ", compression,
                     ", which changes the numbers or is not known; record raw numbers "
                     "uncompressed, or with Deflate or LZW"));
  }
  return absl::OkStatus();
}

// Calls `read(first_row, rows, first_column, columns, bytes)` with every strip or tile in turn.
template <typename Read>
absl::Status ForEachStrip(TIFF* tiff, const TiffHeader& header, const StopCheck& stop,
                          const std::string& message, const Read& read) {
  const uint64_t pixel_bytes = header.bits / 8;
  std::vector<unsigned char> buffer;
  const auto truncated = [&](uint32_t number) {
    return Damaged(message.empty() ? absl::StrCat("strip ", number, " cannot be read") : message);
  };
  if (TIFFIsTiled(tiff) != 0) {
    uint32_t width = 0, height = 0;
    TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &width);
    TIFFGetField(tiff, TIFFTAG_TILELENGTH, &height);
    const uint64_t bytes = uint64_t{width} * height * pixel_bytes;
    if (width == 0 || height == 0 || bytes > kMaxTileBytes || TIFFTileSize64(tiff) != bytes) {
      return absl::InvalidArgumentError(
          absl::StrCat("has tiles of ", width, " x ", height, " px, which cannot be read"));
    }
    buffer.resize(bytes);
    for (uint32_t row = 0; row < header.rows; row += height) {
      for (uint32_t column = 0; column < header.columns; column += width) {
        SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
        const uint32_t tile = TIFFComputeTile(tiff, column, row, 0, 0);
        if (TIFFReadEncodedTile(tiff, tile, buffer.data(), static_cast<tmsize_t>(bytes)) !=
            static_cast<tmsize_t>(bytes)) {
          return truncated(tile);
        }
        read(row, std::min(height, header.rows - row), column,
             std::min(width, header.columns - column), width, buffer.data());
        if (header.columns - column <= width) break;  // the sum could overflow
      }
      if (header.rows - row <= height) break;
    }
    return absl::OkStatus();
  }
  uint32_t rows_per_strip = header.rows;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows_per_strip);
  rows_per_strip = std::clamp<uint32_t>(rows_per_strip, 1, header.rows);
  buffer.resize(uint64_t{rows_per_strip} * header.columns * pixel_bytes);
  uint32_t strip = 0;
  for (uint32_t row = 0; row < header.rows; row += rows_per_strip, ++strip) {
    SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    const uint32_t rows = std::min(rows_per_strip, header.rows - row);
    const auto bytes = static_cast<tmsize_t>(uint64_t{rows} * header.columns * pixel_bytes);
    if (TIFFReadEncodedStrip(tiff, strip, buffer.data(), bytes) != bytes) return truncated(strip);
    read(row, rows, 0, header.columns, header.columns, buffer.data());
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RawImageFile> ReadRawTiff(std::FILE* file, const ImageSizeCheck& check_size,
                                         const StopCheck& stop) {
  std::string message;
  const Tiff tiff = Open(file, &message);
  if (tiff == nullptr) {
    return Damaged(message.empty() ? "it has no image file directory" : message);
  }
  TiffHeader header;
  SIGHTLINE_RETURN_IF_ERROR(ReadHeader(tiff.get(), &header));
  const auto side = [](uint32_t value) {
    return static_cast<int>(std::min<uint32_t>(value, std::numeric_limits<int>::max()));
  };
  SIGHTLINE_RETURN_IF_ERROR(check_size(side(header.columns), side(header.rows)));
  RawImageFile image;
  image.file_bits = header.bits;
  image.raw_dn = Image<uint16_t>(side(header.columns), side(header.rows));
  const auto copy = [&](uint32_t first_row, uint32_t rows, uint32_t first_column, uint32_t columns,
                        uint32_t width, const unsigned char* bytes) {
    for (uint32_t row = 0; row < rows; ++row) {
      uint16_t* out = image.raw_dn.Row(static_cast<int>(first_row + row)) + first_column;
      const size_t begin = size_t{row} * width;
      if (header.bits == 8) {
        std::copy_n(bytes + begin, columns, out);
      } else {
        std::memcpy(out, bytes + 2 * begin, size_t{columns} * 2);
      }
    }
  };
  SIGHTLINE_RETURN_IF_ERROR(ForEachStrip(tiff.get(), header, stop, message, copy));
  return image;
}

}  // namespace sightline
