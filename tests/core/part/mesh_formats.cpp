// SPDX-License-Identifier: Apache-2.0
#include "tests/core/part/mesh_formats.h"

#include "absl/strings/escaping.h"

namespace sightline {

std::string GltfText(const TriangleMesh& mesh) {
  const std::string glb = GlbOf(mesh).ToBytes();
  uint32_t json_size = 0, binary_size = 0;
  std::memcpy(&json_size, glb.data() + 12, 4);
  std::memcpy(&binary_size, glb.data() + 20 + json_size, 4);
  std::string json = glb.substr(20, json_size);
  const std::string binary = glb.substr(28 + json_size, binary_size);
  const std::string buffer = absl::StrCat("[{\"byteLength\": ", binary.size(), "}]");
  const size_t at = json.find(buffer);
  json.replace(at, buffer.size(),
               absl::StrCat("[{\"byteLength\": ", binary.size(),
                            ", \"uri\": \"data:application/octet-stream;base64,",
                            absl::Base64Escape(binary), "\"}]"));
  return json + "\n";
}

const std::vector<MeshFormat>& MeshFormats() {
  static const std::vector<MeshFormat> formats = {
      {"ASCII STL", "stl", true, AsciiStl},
      {"binary STL", "stl", false, [](const TriangleMesh& mesh) { return BinaryStl(mesh); }},
      {"OBJ", "obj", true, Obj},
      {"ASCII PLY", "ply", true, [](const TriangleMesh& mesh) { return Ply(mesh, "ascii"); }},
      {"PLY, little-endian", "ply", false,
       [](const TriangleMesh& mesh) { return Ply(mesh, "binary_little_endian"); }},
      {"PLY, big-endian", "ply", false,
       [](const TriangleMesh& mesh) { return Ply(mesh, "binary_big_endian"); }},
      {"GLB", "glb", false, [](const TriangleMesh& mesh) { return GlbOf(mesh).ToBytes(); }},
      {"glTF", "gltf", true, GltfText},
  };
  return formats;
}

}  // namespace sightline
