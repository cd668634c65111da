// SPDX-License-Identifier: Apache-2.0
// Tags of image files that define the meaning of stored pixels, and one rule for all formats.
//
// A reader collects the tags of its format (ImageTags). CheckTags then decides for all formats in
// the same way: an orientation is applied, every other tag that would change
// the pixels' place or meaning is an error that names the tag. Orientations are numbered as in
// TIFF 6.0 and Exif: 1 is as stored, 3 is rotated by 180 degrees, 5 to 8 swap rows and columns.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"

namespace sightline {

struct OrientationTag {
  std::string where;  // "the TIFF tag Orientation"
  uint64_t value = 1;
};

struct ImageTags {
  std::vector<OrientationTag> orientations;
  // Images of full resolution in the file; thumbnails and masks do not count.
  uint64_t full_images = 1;
  // Position behind the last byte that belongs to the image [bytes].
  uint64_t end = 0;
  // Other reasons to refuse the file. Each ends a sentence that begins with the file's name.
  std::vector<std::string> refusals;
};

// The orientation to apply, 1 to 8. INVALID_ARGUMENT: more than one image, two contradictory tags,
// an orientation that does not exist, or any refusal.
absl::StatusOr<int> CheckTags(const ImageTags& tags);

inline bool SwapsSides(int orientation) { return orientation >= 5; }

// "rotated by 180 degrees".
std::string OrientationText(int orientation);

// The image after the orientation: row 0 is the top row, column 0 the left column.
Image<uint16_t> Oriented(Image<uint16_t> stored, int orientation);

// Adds an orientation tag; `where` names it in messages.
void AddOrientation(std::string_view where, uint64_t value, ImageTags* tags);

// Adds the orientation that an XMP packet states, if it states any: Orientation in the namespace
// http://ns.adobe.com/tiff/1.0/, whatever its prefix. A packet in UTF-16 or UTF-32 is a refusal.
void AddXmpOrientation(std::string_view packet, ImageTags* tags);

}  // namespace sightline
