// SPDX-License-Identifier: Apache-2.0
// Extensions of glTF 2.0. A file may use an extension without requiring it, and viewers then skip
// unknown ones. For a measured part that is wrong: an extension may move, repeat or hide
// geometry. So an extension is obeyed by the reader, is in the list of those that concern no shape,
// or is refused by name wherever the default scene uses it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace sightline {

// Concerns materials, light, sound, names, selection or metadata, but no shape. The lists are of
// the registry of Khronos (https://github.com/KhronosGroup/glTF/tree/main/extensions), 2025.
bool ConcernsNoShape(std::string_view extension);

// Compresses meshes. Without the word "required" the same mesh is there uncompressed.
bool CompressesMeshes(std::string_view extension);

// Checks what a file says it requires: extensions that are obeyed or concern no shape.
// INVALID_ARGUMENT names the first other one.
absl::Status CheckRequiredExtensions(const std::vector<std::string>& required);

// The refusal of an extension at `place`, "nodes[3]".
absl::Status RefuseExtension(const std::string& place, std::string_view extension);

}  // namespace sightline
