// SPDX-License-Identifier: Apache-2.0
#include "core/image/image_tags.h"

#include <algorithm>
#include <array>
#include <set>
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

constexpr std::string_view kXmlBlanks = " \t\r\n";

bool IsXmlNameByte(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '.' ||
         c == ':' || static_cast<unsigned char>(c) >= 0x80;
}

// The names of the property Orientation in an XMP packet: prefixes are the writer's choice, what
// counts is the namespace they are bound to, as in xmlns:t="http://ns.adobe.com/tiff/1.0/".
std::set<std::string> NamesOfXmpOrientation(std::string_view packet) {
  constexpr std::string_view kNamespace = "http://ns.adobe.com/tiff/1.0/";
  constexpr std::string_view kBinding = "xmlns";
  std::set<std::string> names = {"tiff:Orientation"};  // also without the binding
  for (size_t at = packet.find(kNamespace); at != std::string_view::npos;
       at = packet.find(kNamespace, at + kNamespace.size())) {
    std::string_view before = packet.substr(0, at);
    const auto drop_blanks = [&] {
      while (!before.empty() && kXmlBlanks.find(before.back()) != std::string_view::npos) {
        before.remove_suffix(1);
      }
    };
    if (!before.ends_with('"') && !before.ends_with('\'')) continue;
    before.remove_suffix(1);
    drop_blanks();
    if (!before.ends_with('=')) continue;
    before.remove_suffix(1);
    drop_blanks();
    size_t first = before.size();
    while (first > 0 && IsXmlNameByte(before[first - 1])) --first;
    std::string_view name = before.substr(first);
    if (!name.starts_with(kBinding)) continue;
    name.remove_prefix(kBinding.size());
    if (name.empty()) {
      names.insert("Orientation");  // of the elements without a prefix
    } else if (name.front() == ':') {
      names.insert(absl::StrCat(std::string(name.substr(1)), ":Orientation"));
    }
  }
  return names;
}

// Adds each attribute NAME="3" and each element <NAME>3</NAME> of an XMP packet whose name is one
// of `names`, in one pass.
void AddOrientationsNamed(const std::set<std::string>& names, std::string_view packet,
                          ImageTags* tags) {
  constexpr std::string_view kLocalName = "Orientation";
  for (size_t at = packet.find(kLocalName); at != std::string_view::npos;
       at = packet.find(kLocalName, at)) {
    size_t first = at;
    at += kLocalName.size();
    if (at < packet.size() && IsXmlNameByte(packet[at])) continue;
    while (first > 0 && IsXmlNameByte(packet[first - 1])) --first;
    const bool closing = first > 0 && packet[first - 1] == '/';
    if (closing || !names.contains(std::string(packet.substr(first, at - first)))) continue;
    size_t digit = packet.find_first_not_of(" \t\r\n", at);
    if (digit == std::string_view::npos) break;
    // The value of an element stands behind its attributes, such as a namespace.
    if (packet[digit] != '=') digit = packet.find('>', digit);
    if (digit == std::string_view::npos) break;
    digit = packet.find_first_not_of(" \t\r\n=\"'>", digit);
    if (digit == std::string_view::npos) break;
    uint64_t value = 0;
    const size_t begin = digit;
    while (digit < packet.size() && digit - begin < 9 &&
           absl::ascii_isdigit(static_cast<unsigned char>(packet[digit]))) {
      value = 10 * value + static_cast<uint64_t>(packet[digit++] - '0');
    }
    AddOrientation("tiff:Orientation of its XMP packet", value, tags);
  }
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
  // Padding of the packet; in UTF-16 and UTF-32 NUL bytes are elsewhere too.
  while (!packet.empty() && packet.back() == '\0') packet.remove_suffix(1);
  if (packet.find('\0') != std::string_view::npos) {
    tags->refusals.emplace_back(
        "has an XMP packet in UTF-16 or UTF-32, in which an orientation could be: save the image "
        "without it");
    return;
  }
  AddOrientationsNamed(NamesOfXmpOrientation(packet), packet, tags);
}

}  // namespace sightline
