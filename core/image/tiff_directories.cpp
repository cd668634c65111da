// SPDX-License-Identifier: Apache-2.0
#include "core/image/tiff_directories.h"

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr size_t kMostDirectories = 4096;
constexpr uint64_t kMostEntries = 4096;       // of one directory
constexpr uint64_t kMostNumbers = 1 << 22;    // of all directories: strips of all images
constexpr uint64_t kMostNumbersOfOther = 64;  // of tags that list no strips
constexpr uint64_t kMostXmpBytes = 4 << 20;

constexpr uint16_t kStripOffsets = 273, kStripByteCounts = 279, kFreeOffsets = 288,
                   kFreeByteCounts = 289, kTileOffsets = 324, kTileByteCounts = 325,
                   kSubDirectories = 330, kThumbnailOffset = 513, kThumbnailLength = 514,
                   kXmpPacket = 700, kExifDirectory = 34665, kGpsDirectory = 34853,
                   kInteroperabilityDirectory = 40965;
constexpr uint16_t kTypeIfd = 13, kTypeIfd8 = 18;

// Bytes of one value of each type, by the type's number; 0: no such type.
constexpr std::array<uint64_t, 19> kTypeBytes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4,
                                                 8, 4, 8, 4, 0, 0, 8, 8, 8};

bool IsWholeNumber(uint16_t type) {
  return type == 1 || type == 3 || type == 4 || type == kTypeIfd || type == 16 || type == kTypeIfd8;
}

bool ListsParts(uint16_t tag) {
  return tag == kStripOffsets || tag == kStripByteCounts || tag == kTileOffsets ||
         tag == kTileByteCounts || tag == kFreeOffsets || tag == kFreeByteCounts;
}

absl::Status DamagedList(const std::string& reason) {
  return absl::InvalidArgumentError(absl::StrCat("is damaged or truncated: ", reason));
}

class DirectoryWalk {
 public:
  DirectoryWalk(const ByteSource& source, const StopCheck& stop) : source_(source), stop_(stop) {}

  absl::StatusOr<TiffDirectories> Run() {
    std::array<char, 16> head{};
    if (!source_(0, 8, head.data())) return DamagedList("it has no image file directory");
    big_endian_ = head[0] == 'M';
    big_tiff_ = Value(head.data() + 2, 2) == 43;
    if (big_tiff_ && !source_(0, 16, head.data())) {
      return DamagedList("it has no image file directory");
    }
    Reach(0, big_tiff_ ? 16 : 8);
    const uint64_t first = big_tiff_ ? Value(head.data() + 8, 8) : Value(head.data() + 4, 4);
    SIGHTLINE_RETURN_IF_ERROR(Chain(first, /*images=*/true));
    if (found_.images.empty()) return DamagedList("it has no image file directory");
    return std::move(found_);
  }

 private:
  uint64_t Value(const char* bytes, size_t size) const {
    uint64_t value = 0;
    for (size_t i = 0; i < size; ++i) {
      const size_t place = big_endian_ ? i : size - 1 - i;
      value = value << 8 | static_cast<unsigned char>(bytes[place]);
    }
    return value;
  }

  void Reach(uint64_t offset, uint64_t size) {
    // The reader of pixels refuses positions that no file can have.
    if (size > std::numeric_limits<uint64_t>::max() - offset) return;
    found_.end = std::max(found_.end, offset + size);
  }

  // Reads a directory, its sub-directories and those that follow it. Depth is bounded, since each
  // directory is read once and there are at most kMostDirectories.
  absl::Status Chain(uint64_t first, bool images) {
    std::vector<std::pair<uint64_t, bool>> waiting = {{first, images}};
    while (!waiting.empty()) {
      const auto [offset, is_image] = waiting.back();
      waiting.pop_back();
      if (offset == 0) continue;
      SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop_));
      if (!seen_.insert(offset).second) return DamagedList("its list of images refers to itself");
      if (seen_.size() > kMostDirectories) {
        return absl::InvalidArgumentError(
            absl::StrCat("has more than ", kMostDirectories,
                         " images (pages, frames), must have one: save every image in its own "
                         "file"));
      }
      TiffDirectory directory;
      uint64_t next = 0;
      std::vector<uint64_t> below, others;
      SIGHTLINE_RETURN_IF_ERROR(Directory(offset, &directory, &next, &below, &others));
      waiting.emplace_back(next, is_image);
      for (const uint64_t other : others) waiting.emplace_back(other, false);
      for (size_t i = below.size(); i-- > 0;) waiting.emplace_back(below[i], is_image);
      ReachParts(directory);
      if (is_image) found_.images.push_back(std::move(directory));
    }
    return absl::OkStatus();
  }

  absl::Status Directory(uint64_t offset, TiffDirectory* directory, uint64_t* next,
                         std::vector<uint64_t>* below, std::vector<uint64_t>* others) {
    const size_t count_bytes = big_tiff_ ? 8 : 2, entry_bytes = big_tiff_ ? 20 : 12;
    const size_t offset_bytes = big_tiff_ ? 8 : 4;
    std::array<char, 8> number{};
    if (!source_(offset, count_bytes, number.data())) {
      return DamagedList("an image file directory lies behind its end");
    }
    const uint64_t count = Value(number.data(), count_bytes);
    if (count > kMostEntries) {
      return DamagedList(absl::StrCat("an image file directory claims ", count, " tags"));
    }
    std::string entries(count * entry_bytes, '\0');
    const uint64_t behind = offset + count_bytes + entries.size();
    if (!source_(offset + count_bytes, entries.size(), entries.data()) ||
        !source_(behind, offset_bytes, number.data())) {
      return DamagedList("an image file directory lies behind its end");
    }
    *next = Value(number.data(), offset_bytes);
    Reach(behind, offset_bytes);
    for (uint64_t i = 0; i < count; ++i) {
      SIGHTLINE_RETURN_IF_ERROR(Entry(entries.data() + i * entry_bytes, directory, below, others));
    }
    return absl::OkStatus();
  }

  absl::Status Entry(const char* entry, TiffDirectory* directory, std::vector<uint64_t>* below,
                     std::vector<uint64_t>* others) {
    const size_t inline_bytes = big_tiff_ ? 8 : 4;
    const auto tag = static_cast<uint16_t>(Value(entry, 2));
    const auto type = static_cast<uint16_t>(Value(entry + 2, 2));
    const uint64_t count = Value(entry + 4, inline_bytes);
    const char* field = entry + 4 + inline_bytes;
    // Readers skip types that they do not know.
    const uint64_t each = type < kTypeBytes.size() ? kTypeBytes[type] : 0;
    if (each == 0 || count == 0 || count > std::numeric_limits<uint64_t>::max() / each) {
      return absl::OkStatus();
    }
    const uint64_t bytes = count * each;
    const bool is_inline = bytes <= inline_bytes;
    const uint64_t offset = is_inline ? 0 : Value(field, inline_bytes);
    if (!is_inline) Reach(offset, bytes);
    const auto read = [&](uint64_t size, char* out) {
      if (!is_inline) return source_(offset, size, out);
      std::copy_n(field, size, out);
      return true;
    };
    if (tag == kXmpPacket && each == 1) {
      if (bytes > kMostXmpBytes) {
        return absl::InvalidArgumentError(absl::StrCat("has an XMP packet of ", bytes,
                                                       " bytes, must have at most ", kMostXmpBytes,
                                                       ": save the image without it"));
      }
      directory->xmp.resize(bytes);
      if (!read(bytes, directory->xmp.data())) return DamagedList("its XMP packet is cut off");
      return absl::OkStatus();
    }
    if (!IsWholeNumber(type)) return absl::OkStatus();
    const uint64_t wanted = ListsParts(tag) ? count : std::min(count, kMostNumbersOfOther);
    numbers_ += wanted;
    if (numbers_ > kMostNumbers) {
      return absl::InvalidArgumentError(
          absl::StrCat("is divided into more than ", kMostNumbers / 2, " strips or tiles"));
    }
    std::string raw(wanted * each, '\0');
    // Numbers behind the end of the file: the reader of pixels reports that it is truncated.
    if (!read(raw.size(), raw.data())) return absl::OkStatus();
    std::vector<uint64_t>& values = directory->numbers[tag];
    values.clear();
    values.reserve(wanted);
    for (uint64_t i = 0; i < wanted; ++i) values.push_back(Value(raw.data() + i * each, each));
    if (tag == kSubDirectories) {
      *below = values;
    } else if (tag == kExifDirectory || tag == kGpsDirectory || tag == kInteroperabilityDirectory ||
               type == kTypeIfd || type == kTypeIfd8) {
      others->insert(others->end(), values.begin(), values.end());
    }
    return absl::OkStatus();
  }

  void ReachParts(const TiffDirectory& directory) {
    constexpr std::array<std::pair<uint16_t, uint16_t>, 4> kParts = {
        {{kStripOffsets, kStripByteCounts},
         {kTileOffsets, kTileByteCounts},
         {kFreeOffsets, kFreeByteCounts},
         {kThumbnailOffset, kThumbnailLength}}};
    for (const auto& [offset_tag, bytes_tag] : kParts) {
      const std::vector<uint64_t>* offsets = directory.Numbers(offset_tag);
      if (offsets == nullptr) continue;
      const std::vector<uint64_t>* bytes = directory.Numbers(bytes_tag);
      for (size_t i = 0; i < offsets->size(); ++i) {
        // Without its size, a strip may reach to the end of the file.
        if (bytes == nullptr || i >= bytes->size()) {
          found_.end = std::numeric_limits<uint64_t>::max();
          return;
        }
        Reach((*offsets)[i], (*bytes)[i]);
      }
    }
  }

  const ByteSource& source_;
  const StopCheck& stop_;
  bool big_endian_ = false, big_tiff_ = false;
  uint64_t numbers_ = 0;
  std::set<uint64_t> seen_;
  TiffDirectories found_;
};

}  // namespace

uint64_t TiffDirectory::Number(uint16_t tag, uint64_t missing) const {
  const std::vector<uint64_t>* values = Numbers(tag);
  return values == nullptr || values->empty() ? missing : values->front();
}

const std::vector<uint64_t>* TiffDirectory::Numbers(uint16_t tag) const {
  const auto found = numbers.find(tag);
  return found == numbers.end() ? nullptr : &found->second;
}

absl::StatusOr<TiffDirectories> ReadTiffDirectories(const ByteSource& source,
                                                    const StopCheck& stop) {
  return DirectoryWalk(source, stop).Run();
}

}  // namespace sightline
