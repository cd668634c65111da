// SPDX-License-Identifier: Apache-2.0
// Encodes a mesh as a file for a coverage server.
#pragma once

#include <string>

#include "core/part/mesh.h"

namespace sightline {

// Binary little-endian PLY in metres. A mesh from LoadPart is read back with identical vertices,
// so that both sides compute the same PartDigest and, with materials, the same
// PartNameWithMaterials.
std::string EncodePly(const TriangleMesh& mesh, bool with_materials = false);

}  // namespace sightline
