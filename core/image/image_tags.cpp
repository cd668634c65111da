// SPDX-License-Identifier: Apache-2.0
#include "core/image/image_tags.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sightline {
namespace {

constexpr int kLastOrientation = 8;

bool ReversesRows(int orientation) {
  return orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
}

bool ReversesColumns(int orientation) {
  return orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
}

}  // namespace

absl::StatusOr<int> CheckTags(const ImageTags& tags) {
  if (!tags.refusals.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(tags.refusals, "; it "));
  }
  if (tags.full_images > 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("has ", tags.full_images,
                     " images (pages, frames), must have one: save every image in its own file"));
  }
  const OrientationTag* obeyed = nullptr;
  for (const OrientationTag& tag : tags.orientations) {
    if (tag.value < 1 || tag.value > kLastOrientation) {
      return absl::InvalidArgumentError(
          absl::StrCat(tag.where, " is ", tag.value, ", must be 1 to ", kLastOrientation));
    }
    if (obeyed != nullptr && obeyed->value != tag.value) {
      return absl::InvalidArgumentError(
          absl::StrCat("can be read in two ways: ", obeyed->where, " is ", obeyed->value, ", ",
                       tag.where, " is ", tag.value, "; save the image without these tags"));
    }
    obeyed = &tag;
  }
  return obeyed == nullptr ? 1 : static_cast<int>(obeyed->value);
}

std::string OrientationText(int orientation) {
  constexpr std::array<std::string_view, kLastOrientation> kTexts = {
      "as stored",
      "mirrored left to right",
      "rotated by 180 degrees",
      "mirrored top to bottom",
      "mirrored at the diagonal from the upper left corner",
      "rotated by 90 degrees clockwise",
      "mirrored at the diagonal from the upper right corner",
      "rotated by 90 degrees counterclockwise"};
  return std::string(kTexts[static_cast<size_t>(std::clamp(orientation, 1, kLastOrientation) - 1)]);
}

Image<uint16_t> Oriented(Image<uint16_t> stored, int orientation) {
  const bool rows_reversed = ReversesRows(orientation);
  const bool columns_reversed = ReversesColumns(orientation);
  if (SwapsSides(orientation)) {
    // Stored rows become columns.
    Image<uint16_t> seen(stored.rows_px, stored.columns_px);
    for (int row = 0; row < stored.rows_px; ++row) {
      const int column = rows_reversed ? stored.rows_px - 1 - row : row;
      const uint16_t* values = stored.Row(row);
      for (int i = 0; i < stored.columns_px; ++i) {
        seen.At(columns_reversed ? stored.columns_px - 1 - i : i, column) = values[i];
      }
    }
    return seen;
  }
  if (rows_reversed) {
    for (int row = 0; row < stored.rows_px / 2; ++row) {
      std::swap_ranges(stored.Row(row), stored.Row(row) + stored.columns_px,
                       stored.Row(stored.rows_px - 1 - row));
    }
  }
  if (columns_reversed) {
    for (int row = 0; row < stored.rows_px; ++row) {
      std::reverse(stored.Row(row), stored.Row(row) + stored.columns_px);
    }
  }
  return stored;
}

void AddOrientation(std::string_view where, uint64_t value, ImageTags* tags) {
  OrientationTag& tag = tags->orientations.emplace_back();
  tag.where = where;
  tag.value = value;
}

void AddXmpOrientation(std::string_view packet, ImageTags* tags) {
  // An attribute tiff:Orientation="3" or an element <tiff:Orientation>3</tiff:Orientation>.
  constexpr std::string_view kName = "tiff:Orientation";
  for (size_t at = packet.find(kName); at != std::string_view::npos; at = packet.find(kName, at)) {
    const bool closing = at > 0 && packet[at - 1] == '/';
    at += kName.size();
    if (closing) continue;
    size_t digit = packet.find_first_not_of(" \t\r\n=\"'>", at);
    if (digit == std::string_view::npos) break;
    uint64_t value = 0;
    const size_t first = digit;
    while (digit < packet.size() && digit - first < 9 &&
           absl::ascii_isdigit(static_cast<unsigned char>(packet[digit]))) {
      value = 10 * value + static_cast<uint64_t>(packet[digit++] - '0');
    }
    AddOrientation("tiff:Orientation of its XMP packet", value, tags);
  }
}

}  // namespace sightline
