// SPDX-License-Identifier: Apache-2.0
// A mesh as a file that a coverage server takes.
#pragma once

#include <string>

#include "core/part/mesh.h"

namespace sightline {

// Binary little-endian PLY in metres. A mesh that came from LoadPart is read back vertex by vertex
// as it is, so that both sides compute the same PartDigest, and with materials the same
// PartNameWithMaterials.
std::string EncodePly(const TriangleMesh& mesh, bool with_materials = false);

}  // namespace sightline
