// SPDX-License-Identifier: Apache-2.0
// The files that a glTF file needs beside it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

// A URI without its percent-encoding (RFC 3986, 2.1). Other percent signs stay.
std::string DecodedUri(std::string_view uri);

struct GltfBufferFile {
  std::string place;  // "buffers[0].uri"
  std::string file;   // relative to the folder of the glTF file, decoded
};

// Files that the buffers of a .gltf file name, in the order of the file; empty if every buffer is
// embedded (a data URI). `json`: the bytes of the file; they are read in one pass and not kept.
// LoadPart reports other errors of the file. INVALID_ARGUMENT: the text is no JSON, or nested more
// than 64 deep; the message is the reason alone.
absl::StatusOr<std::vector<GltfBufferFile>> GltfBufferFiles(std::string_view json);

}  // namespace sightline
