// SPDX-License-Identifier: Apache-2.0
// Chunks of a PNG file that change the place or the meaning of its pixels: eXIf and XMP
// (orientation), acTL (animation), tRNS (transparency). Chunks are passed over by their lengths;
// nothing is unpacked.
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/image/raw_image_formats.h"
#include "core/image/tiff_directories.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr uint64_t kSignatureBytes = 8;
constexpr uint64_t kMostMetadataBytes = 4 << 20;
constexpr uint64_t kChunksPerStopCheck = 1024;
constexpr uint16_t kExifOrientation = 274;
constexpr std::string_view kXmpKey("XML:com.adobe.xmp\0", 18);

uint32_t BigEndian32(const char* bytes) {
  uint32_t value = 0;
  for (int i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

void AddExif(const std::string& exif, const StopCheck& stop, ImageTags* tags) {
  const ByteSource source = [&](uint64_t offset, size_t size, char* out) {
    if (offset > exif.size() || size > exif.size() - offset) return false;
    std::copy_n(exif.data() + offset, size, out);
    return true;
  };
  const bool ordered = exif.starts_with("II") || exif.starts_with("MM");
  const absl::StatusOr<TiffDirectories> directories = ReadTiffDirectories(source, stop);
  if (!ordered || !directories.ok()) {
    tags->refusals.emplace_back("has a damaged eXIf chunk, in which an orientation could be");
    return;
  }
  const TiffDirectory& first = directories->images.front();
  if (first.Numbers(kExifOrientation) == nullptr) return;
  AddOrientation("Orientation of its eXIf chunk", first.Number(kExifOrientation, 1), tags);
}

void AddInternationalText(std::string_view text, ImageTags* tags) {
  if (!text.starts_with(kXmpKey) || text.size() < kXmpKey.size() + 2) return;
  if (text[kXmpKey.size()] != 0) {
    tags->refusals.emplace_back(
        "has a compressed XMP packet, in which an orientation could be: save the image without it");
    return;
  }
  // Behind the key: two bytes about compression, a language and a translated key, each with a NUL.
  size_t packet = kXmpKey.size() + 2;
  for (int i = 0; i < 2; ++i) packet = std::min(text.find('\0', packet), text.size() - 1) + 1;
  AddXmpOrientation(text.substr(packet), tags);
}

bool IsText(std::string_view type) { return type == "tEXt" || type == "zTXt" || type == "iTXt"; }

// How ImageMagick before version 7 and others keep Exif data: as digits in a text.
bool IsRawProfile(std::string_view text) {
  return text.starts_with("Raw profile type exif") || text.starts_with("Raw profile type APP1") ||
         text.starts_with("Raw profile type xmp");
}

}  // namespace

absl::StatusOr<ImageTags> ReadPngTags(std::FILE* file, const StopCheck& stop) {
  ImageTags tags;
  uint64_t at = kSignatureBytes, frames = 0;
  bool image_is_frame = false, in_pixels = false;
  for (uint64_t number = 0;; ++number) {
    if (number % kChunksPerStopCheck == 0) {
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    }
    std::array<char, 8> head{};
    if (fseeko(file, static_cast<off_t>(at), SEEK_SET) != 0 ||
        std::fread(head.data(), 1, head.size(), file) != head.size()) {
      break;  // libpng says that the file is truncated
    }
    const uint64_t length = BigEndian32(head.data());
    const std::string_view type(head.data() + 4, 4);
    if (length > 0x7fffffff) break;
    at += head.size() + length + 4;
    tags.end = at;
    if (type == "IEND") break;
    if (type == "IDAT") in_pixels = true;
    if (type == "tRNS")
      tags.refusals.emplace_back("has transparency (tRNS), must be greyscale alone");
    if (type == "fcTL" && !in_pixels) image_is_frame = true;
    if (type != "eXIf" && type != "acTL" && !IsText(type)) continue;
    // The key of a long text is enough.
    const bool whole = length <= kMostMetadataBytes;
    if (!whole && type == "eXIf") {
      tags.refusals.push_back(absl::StrCat("has an eXIf chunk of ", length,
                                           " bytes, must have at most ", kMostMetadataBytes));
      continue;
    }
    std::string data(
        whole && type != "zTXt" && type != "tEXt" ? length + 4 : std::min<uint64_t>(length, 32),
        '\0');
    if (std::fread(data.data(), 1, data.size(), file) != data.size()) break;
    if (IsText(type) && IsRawProfile(data)) {
      tags.refusals.emplace_back(
          "keeps Exif or XMP data as a text (\"Raw profile type ...\"), in which an orientation "
          "could be: save the image without it");
    }
    if (type == "zTXt" || type == "tEXt") continue;
    if (!whole) {
      if (data.starts_with(kXmpKey)) {
        tags.refusals.push_back(absl::StrCat("has an XMP packet of ", length,
                                             " bytes, must have at most ", kMostMetadataBytes));
      }
      continue;
    }
    const uint32_t checksum = BigEndian32(data.data() + length);
    data.resize(length);
    uLong computed = crc32(0, reinterpret_cast<const Bytef*>(head.data() + 4), 4);
    computed = crc32(computed, reinterpret_cast<const Bytef*>(data.data()),
                     static_cast<uInt>(data.size()));
    if (computed != checksum) {
      return absl::InvalidArgumentError(absl::StrCat(
          "is damaged or truncated: the checksum of its chunk ", std::string(type), " is wrong"));
    }
    if (type == "eXIf") AddExif(data, stop, &tags);
    if (type == "acTL" && length >= 4) frames = BigEndian32(data.data());
    if (type == "iTXt") AddInternationalText(data, &tags);
  }
  // An animation may show the still image as its first frame or not at all.
  if (frames > 0) tags.full_images = image_is_frame ? frames : frames + 1;
  return tags;
}

}  // namespace sightline
