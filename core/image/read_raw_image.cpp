// SPDX-License-Identifier: Apache-2.0
#include "core/image/read_raw_image.h"

#include <array>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/image/raw_image_formats.h"

namespace sightline {
namespace {

// By the first bytes, whatever the name says.
enum class FileType { kPng, kTiff, kJpeg, kOther };

FileType TypeOf(std::string_view head) {
  const auto starts = [&](std::string_view magic) { return head.substr(0, magic.size()) == magic; };
  if (starts("\x89PNG\r\n\x1a\n")) return FileType::kPng;
  if (starts("\xff\xd8\xff") || (head.size() >= 8 && head.substr(4, 4) == "jP  ")) {
    return FileType::kJpeg;
  }
  if (starts(std::string_view("II*\0", 4)) || starts(std::string_view("MM\0*", 4)) ||
      starts(std::string_view("II+\0", 4)) || starts(std::string_view("MM\0+", 4))) {
    return FileType::kTiff;
  }
  return FileType::kOther;
}

absl::Status CheckSides(int columns_px, int rows_px) {
  if (columns_px <= kMaxImageSide_px && rows_px <= kMaxImageSide_px) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "is ", columns_px, " x ", rows_px, " px, must have at most ", kMaxImageSide_px, " a side"));
}

absl::StatusOr<RawImageFile> Read(std::FILE* file, const ImageSizeCheck& check_size,
                                  const StopCheck& stop) {
  std::array<char, 12> head{};
  const size_t size = std::fread(head.data(), 1, head.size(), file);
  if (size == 0) return absl::InvalidArgumentError("is empty");
  const ImageSizeCheck check = [&](int columns_px, int rows_px) {
    if (absl::Status status = CheckSides(columns_px, rows_px); !status.ok()) return status;
    return check_size ? check_size(columns_px, rows_px) : absl::OkStatus();
  };
  switch (TypeOf({head.data(), size})) {
    case FileType::kPng:
      return ReadRawPng(file, check, stop);
    case FileType::kTiff:
      return ReadRawTiff(file, check, stop);
    case FileType::kJpeg:
      return absl::InvalidArgumentError(
          "is a JPEG file: its compression has changed the numbers; record raw numbers in 16-bit "
          "greyscale PNG or TIFF");
    case FileType::kOther:
      break;
  }
  return absl::InvalidArgumentError("is neither a PNG nor a TIFF file, must be 16-bit greyscale");
}

}  // namespace

absl::StatusOr<RawImageFile> ReadRawImageFile(const std::string& path,
                                              const ImageSizeCheck& check_size,
                                              const StopCheck& stop) {
  const absl::StatusOr<File> file = OpenRegularFile(path);
  if (!file.ok()) return file.status();
  absl::StatusOr<RawImageFile> image = Read(file->get(), check_size, stop);
  if (image.ok() || !absl::IsInvalidArgument(image.status())) return image;
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", image.status().message()));
}

absl::StatusOr<Image<uint16_t>> ReadRawImage(const std::string& path) {
  absl::StatusOr<RawImageFile> file = ReadRawImageFile(path);
  if (!file.ok()) return file.status();
  return std::move(file->raw_dn);
}

}  // namespace sightline
