// SPDX-License-Identifier: Apache-2.0
#include "core/image/read_raw_image.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/image/raw_image_formats.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Zeros behind the image that fill the last block of a disk or a camera's buffer.
constexpr uint64_t kMaxPaddingBytes = 4096;

bool IsPng(std::string_view head) { return head.starts_with("\x89PNG\r\n\x1a\n"); }

bool IsTiff(std::string_view head) {
  return head.starts_with(std::string_view("II*\0", 4)) ||
         head.starts_with(std::string_view("MM\0*", 4)) ||
         head.starts_with(std::string_view("II+\0", 4)) ||
         head.starts_with(std::string_view("MM\0+", 4));
}

bool IsJpeg(std::string_view head) {
  return head.starts_with("\xff\xd8\xff") || (head.size() >= 8 && head.substr(4, 4) == "jP  ");
}

// Table of formats. The rules for tags and left-over bytes apply to all of them.
struct RawImageFormat {
  bool (*is)(std::string_view head);
  absl::StatusOr<ImageTags> (*read_tags)(std::FILE*, const StopCheck&);
  absl::StatusOr<RawImageFile> (*read_pixels)(std::FILE*, const ImageSizeCheck&, const StopCheck&);
};
constexpr RawImageFormat kRawImageFormats[] = {
    {IsPng, ReadPngTags, ReadRawPng},
    {IsTiff, ReadTiffTags, ReadRawTiff},
};

absl::Status CheckSides(int columns_px, int rows_px) {
  if (columns_px <= kMaxImageSide_px && rows_px <= kMaxImageSide_px) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "is ", columns_px, " x ", rows_px, " px, must have at most ", kMaxImageSide_px, " a side"));
}

// OK if only padding follows the image.
absl::Status CheckBytesBehind(std::FILE* file, uint64_t end) {
  if (fseeko(file, 0, SEEK_END) != 0) return absl::InvalidArgumentError("cannot be read");
  const auto size = static_cast<uint64_t>(ftello(file));
  if (size <= end) return absl::OkStatus();
  const uint64_t left_over = size - end;
  bool zeros = left_over <= kMaxPaddingBytes;
  if (zeros) {
    fseeko(file, static_cast<off_t>(end), SEEK_SET);
    std::array<char, kMaxPaddingBytes> bytes{};
    const size_t read = std::fread(bytes.data(), 1, left_over, file);
    zeros = read == left_over &&
            std::all_of(bytes.begin(), bytes.begin() + read, [](char byte) { return byte == 0; });
  }
  if (zeros) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("has ", left_over,
                   " bytes behind its image that belong to nothing in it: more images, or another "
                   "file; save the image again"));
}

absl::StatusOr<RawImageFile> ReadFormat(const RawImageFormat& format, std::FILE* file,
                                        const ImageSizeCheck& check_size, const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(const ImageTags tags, format.read_tags(file, stop));
  SIGHTLINE_ASSIGN_OR_RETURN(const int orientation, CheckTags(tags));
  const ImageSizeCheck check_stored = [&](int columns_px, int rows_px) {
    if (SwapsSides(orientation)) std::swap(columns_px, rows_px);
    return check_size(columns_px, rows_px);
  };
  SIGHTLINE_ASSIGN_OR_RETURN(RawImageFile image, format.read_pixels(file, check_stored, stop));
  SIGHTLINE_RETURN_IF_ERROR(CheckBytesBehind(file, tags.end));
  image.raw_dn = Oriented(std::move(image.raw_dn), orientation);
  image.orientation = orientation;
  return image;
}

absl::StatusOr<RawImageFile> Read(std::FILE* file, const ImageSizeCheck& check_size,
                                  const StopCheck& stop) {
  std::array<char, 12> head{};
  const size_t size = std::fread(head.data(), 1, head.size(), file);
  if (size == 0) return absl::InvalidArgumentError("is empty");
  const ImageSizeCheck check = [&](int columns_px, int rows_px) {
    SIGHTLINE_RETURN_IF_ERROR(CheckSides(columns_px, rows_px));
    return check_size ? check_size(columns_px, rows_px) : absl::OkStatus();
  };
  const std::string_view start(head.data(), size);
  for (const RawImageFormat& format : kRawImageFormats) {
    if (format.is(start)) return ReadFormat(format, file, check, stop);
  }
  if (IsJpeg(start)) {
    return absl::InvalidArgumentError(
        "is a JPEG file: its compression has changed the numbers; record raw numbers in 16-bit "
        "greyscale PNG or TIFF");
  }
  return absl::InvalidArgumentError("is neither a PNG nor a TIFF file, must be 16-bit greyscale");
}

}  // namespace

absl::StatusOr<RawImageFile> ReadRawImageFile(const std::string& path,
                                              const ImageSizeCheck& check_size,
                                              const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(const File file, OpenRegularFile(path));
  absl::StatusOr<RawImageFile> image = Read(file.get(), check_size, stop);
  if (image.ok() || !absl::IsInvalidArgument(image.status())) return image;
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", image.status().message()));
}

absl::StatusOr<Image<uint16_t>> ReadRawImage(const std::string& path) {
  SIGHTLINE_ASSIGN_OR_RETURN(RawImageFile file, ReadRawImageFile(path));
  return std::move(file.raw_dn);
}

}  // namespace sightline
