// SPDX-License-Identifier: Apache-2.0
// Image file directories (lists of tags) of a TIFF file (classic and BigTIFF) or of an Exif block,
// which has the same form. libtiff reads the first image's pixels; this reader finds the rest:
// further images, thumbnails, and the end of the file's contents.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/status/stop_check.h"

namespace sightline {

// Fills `out` with `size` bytes from position `offset`; false if there are fewer.
using ByteSource = std::function<bool(uint64_t offset, size_t size, char* out)>;

struct TiffDirectory {
  // Whole numbers of each tag without sign (BYTE, SHORT, LONG, IFD and their 64-bit forms).
  std::map<uint16_t, std::vector<uint64_t>> numbers;
  std::string xmp;  // tag 700

  // The tag's first number; `missing` if the tag is not there.
  uint64_t Number(uint16_t tag, uint64_t missing) const;
  const std::vector<uint64_t>* Numbers(uint16_t tag) const;
};

struct TiffDirectories {
  std::vector<TiffDirectory> images;  // in the order of the file, each before its SubIFDs
  uint64_t end = 0;                   // behind the last byte that a directory refers to
};

// INVALID_ARGUMENT: a directory lies outside the file, refers to itself, or is larger than a file
// of one image needs.
absl::StatusOr<TiffDirectories> ReadTiffDirectories(const ByteSource& source,
                                                    const StopCheck& stop);

}  // namespace sightline
