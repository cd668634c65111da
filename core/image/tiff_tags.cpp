// SPDX-License-Identifier: Apache-2.0
// Tags of a TIFF file that change the place or the meaning of its pixels.
#include <cstdio>
#include <limits>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/image/raw_image_formats.h"
#include "core/image/tiff_directories.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr uint16_t kNewSubfileType = 254, kSubfileType = 255, kImageWidth = 256, kImageLength = 257,
                   kBitsPerSample = 258, kCompression = 259, kPhotometric = 262, kFillOrder = 266,
                   kOrientationTag = 274, kSamplesPerPixel = 277, kRowsPerStrip = 278,
                   kStripOffsetsTag = 273, kStripByteCountsTag = 279, kTileWidth = 322,
                   kTileLength = 323, kTileOffsetsTag = 324, kTileByteCountsTag = 325,
                   kImageDepth = 32997, kCfaPattern = 33422, kLinearizationTable = 50712,
                   kDngVersion = 50706;
constexpr uint64_t kPhotometricCfa = 32803;

enum class Role { kFull, kReduced, kMask };

Role RoleOf(const TiffDirectory& directory) {
  const uint64_t type = directory.Number(kNewSubfileType, 0);
  if ((type & 4) != 0) return Role::kMask;
  if ((type & 1) != 0 || directory.Number(kSubfileType, 1) == 2) return Role::kReduced;
  return Role::kFull;
}

void RefuseMeanings(const TiffDirectory& first, ImageTags* tags) {
  std::vector<std::string>& refusals = tags->refusals;
  if (first.Numbers(kDngVersion) != nullptr || first.Numbers(kLinearizationTable) != nullptr) {
    refusals.emplace_back(
        "is a DNG file, whose tags (linearisation, active area, opcodes) change the numbers; save "
        "raw numbers as greyscale TIFF");
  }
  if (first.Number(kFillOrder, 1) != 1) {
    refusals.push_back(absl::StrCat("has FillOrder ", first.Number(kFillOrder, 1),
                                    ": bits stored in reverse order are not read"));
  }
  if (first.Number(kImageDepth, 1) > 1) {
    tags->full_images *= first.Number(kImageDepth, 1);
  }
  const std::vector<uint64_t>* pattern = first.Numbers(kCfaPattern);
  const std::vector<uint64_t> rggb = {0, 1, 1, 2};
  if (first.Number(kPhotometric, 1) == kPhotometricCfa && pattern != nullptr && *pattern != rggb) {
    refusals.emplace_back("has a colour filter pattern (CFAPattern) other than RGGB");
  }
}

// Whether strips and tiles hold more than the image's size needs.
void RefuseLeftOverPixels(const TiffDirectory& first, ImageTags* tags) {
  const uint64_t columns = first.Number(kImageWidth, 0), rows = first.Number(kImageLength, 0);
  const uint64_t bits = first.Number(kBitsPerSample, 1);
  constexpr uint64_t kMostSide = std::numeric_limits<uint32_t>::max();
  // Other images are refused by the reader of pixels.
  if (columns == 0 || rows == 0 || columns > kMostSide || rows > kMostSide ||
      first.Number(kSamplesPerPixel, 1) != 1 || (bits != 8 && bits != 16)) {
    return;
  }
  const auto parts = [](uint64_t size, uint64_t part) { return size / part + (size % part != 0); };
  const bool tiled = first.Numbers(kTileWidth) != nullptr;
  const uint64_t width = tiled ? first.Number(kTileWidth, columns) : columns;
  uint64_t height =
      tiled ? first.Number(kTileLength, rows) : std::min(first.Number(kRowsPerStrip, rows), rows);
  if (width == 0 || width > kMostSide || height > kMostSide) return;
  height = std::max<uint64_t>(height, 1);
  const uint64_t expected = parts(columns, width) * parts(rows, height);
  const std::vector<uint64_t>* offsets = first.Numbers(tiled ? kTileOffsetsTag : kStripOffsetsTag);
  const std::vector<uint64_t>* bytes =
      first.Numbers(tiled ? kTileByteCountsTag : kStripByteCountsTag);
  const char* name = tiled ? "tiles" : "strips";
  if (offsets != nullptr && offsets->size() > expected) {
    tags->refusals.push_back(absl::StrCat("has ", offsets->size(), " ", name, ", but ", columns,
                                          " x ", rows, " px need only ", expected));
    return;
  }
  if (bytes == nullptr || first.Number(kCompression, 1) != 1) return;
  const double most = static_cast<double>(width) * static_cast<double>(height * (bits / 8));
  for (const uint64_t each : *bytes) {
    if (static_cast<double>(each) <= most) continue;
    tags->refusals.push_back(absl::StrCat("has ", name, " of ", each, " bytes, but their size of ",
                                          width, " x ", height, " px needs only ",
                                          static_cast<uint64_t>(most)));
    return;
  }
}

}  // namespace

absl::StatusOr<ImageTags> ReadTiffTags(std::FILE* file, const StopCheck& stop) {
  const ByteSource source = [file](uint64_t offset, size_t size, char* out) {
    return offset <= static_cast<uint64_t>(std::numeric_limits<off_t>::max()) &&
           fseeko(file, static_cast<off_t>(offset), SEEK_SET) == 0 &&
           std::fread(out, 1, size, file) == size;
  };
  SIGHTLINE_ASSIGN_OR_RETURN(const TiffDirectories directories, ReadTiffDirectories(source, stop));
  const TiffDirectory& first = directories.images.front();
  ImageTags tags;
  tags.end = directories.end;
  tags.full_images = 0;
  for (const TiffDirectory& image : directories.images) {
    if (RoleOf(image) == Role::kFull) ++tags.full_images;
  }
  // A single image may be the small copy of one in another file.
  if (directories.images.size() == 1) tags.full_images = 1;
  const bool is_mask = RoleOf(first) == Role::kMask;
  if (is_mask || (RoleOf(first) != Role::kFull && directories.images.size() > 1)) {
    tags.refusals.push_back(absl::StrCat("begins with ", is_mask ? "a mask" : "a thumbnail",
                                         " (NewSubfileType), must hold one image alone"));
  }
  RefuseMeanings(first, &tags);
  RefuseLeftOverPixels(first, &tags);
  if (first.Numbers(kOrientationTag) != nullptr) {
    AddOrientation("the TIFF tag Orientation", first.Number(kOrientationTag, 1), &tags);
  }
  AddXmpOrientation(first.xmp, &tags);
  return tags;
}

}  // namespace sightline
