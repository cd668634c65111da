// SPDX-License-Identifier: Apache-2.0
// Extensions of glTF 2.0. A file may use an extension without requiring it, and viewers then skip
// unknown ones. For a measured part that is wrong: an extension may move, repeat or hide
// geometry. So the reader implements an extension, or the extension is in the list of those without
// effect on the shape, or it is refused by name if the default scene uses it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace sightline {

// True for extensions about materials, light, sound, names, selection or metadata, not shape. The
// lists follow the registry of Khronos (https://github.com/KhronosGroup/glTF/tree/main/extensions),
// 2025.
bool ConcernsNoShape(std::string_view extension);

// True for extensions that compress meshes. If such an extension is not required, the file also has
// the uncompressed mesh.
bool CompressesMeshes(std::string_view extension);

// Checks the extensions that a file requires: the reader must implement them, or they must not
// affect the shape. INVALID_ARGUMENT names the first other one.
absl::Status CheckRequiredExtensions(const std::vector<std::string>& required);

// The refusal of an extension at `place`, "nodes[3]".
absl::Status RefuseExtension(const std::string& place, std::string_view extension);

}  // namespace sightline
