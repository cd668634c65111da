// SPDX-License-Identifier: Apache-2.0
// Checks, in the JSON itself, the properties of glTF 2.0 that determine the shape of a part.
//
// tinygltf drops an optional property of a wrong type and uses the default of the specification: it
// ignores a scale of ["2", "2", "2"] and reads a mode of 5.0 as triangles. The part would be wrong.
// So one table states the type of each property, and a file that differs is refused.
#pragma once

#include <nlohmann/json.hpp>

#include "absl/status/status.h"

namespace sightline {

// INVALID_ARGUMENT names the place ("nodes[3].scale") of the first property that has a wrong type
// or range, or that differs from one of the table by upper and lower case only. Whole numbers must
// be written without a fraction and without an exponent. Refused too: an asset.version other than
// 2.x, an asset.minVersion above 2.0, an attribute of EXT_mesh_gpu_instancing that the extension
// does not have. Which properties are there, and where indices lead, is the reader's to check.
absl::Status CheckGltfProperties(const nlohmann::json& root);

}  // namespace sightline
