// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "tools/step_import/shape_mesh.h"

namespace sightline {

struct GlbDescription {
  std::string generator;
  // Free facts about the file, written to asset.extras.
  std::map<std::string, std::variant<std::string, double>> extras;
};

// Writes binary glTF 2.0: one node and one mesh per entry, one primitive per material (materials by
// name only), indexed triangles, positions as float
// METRES from the mesh's origin, which is the node's translation, axes as modelled, no normals
// (flat facets are the truth about them).
// Throws std::invalid_argument if there is no triangle or an index points nowhere, and
// std::runtime_error if the file cannot be written.
void WriteGlb(const std::vector<ShapeMesh>& meshes, const GlbDescription& description,
              const std::filesystem::path& file);

}  // namespace sightline
