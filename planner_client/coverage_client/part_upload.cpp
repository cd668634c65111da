// SPDX-License-Identifier: Apache-2.0
#include "planner_client/coverage_client/part_upload.h"

#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace sightline {

static_assert(std::endian::native == std::endian::little);

std::string EncodePly(const TriangleMesh& mesh, bool with_materials) {
  const bool has_materials = with_materials && !mesh.triangle_material.empty();
  std::string bytes = absl::StrCat("ply\nformat binary_little_endian 1.0\n");
  if (has_materials) {
    absl::StrAppend(&bytes, "element material ", mesh.material_names.size(),
                    "\nproperty list uint uchar name\n");
  }
  absl::StrAppend(&bytes, "element vertex ", mesh.positions_m.size(),
                  "\nproperty float x\nproperty float y\nproperty float z\nelement face ",
                  mesh.triangles.size(), "\nproperty list uchar uint vertex_indices\n",
                  has_materials ? "property ushort material_index\n" : "", "end_header\n");
  if (has_materials) {
    for (const std::string& name : mesh.material_names) {
      const auto size = static_cast<uint32_t>(name.size());
      bytes.append(reinterpret_cast<const char*>(&size), sizeof(size));
      bytes += name;
    }
  }
  constexpr size_t kVertexBytes = 3 * sizeof(float);
  constexpr size_t kCornerBytes = 1 + 3 * sizeof(uint32_t);
  const size_t face_bytes = kCornerBytes + (has_materials ? sizeof(uint16_t) : 0);
  size_t offset = bytes.size();
  bytes.resize(offset + kVertexBytes * mesh.positions_m.size() +
               face_bytes * mesh.triangles.size());
  for (const Eigen::Vector3f& position : mesh.positions_m) {
    std::memcpy(bytes.data() + offset, position.data(), kVertexBytes);
    offset += kVertexBytes;
  }
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    bytes[offset] = 3;
    std::memcpy(bytes.data() + offset + 1, mesh.triangles[t].data(), kCornerBytes - 1);
    if (has_materials) {
      std::memcpy(bytes.data() + offset + kCornerBytes, &mesh.triangle_material[t],
                  sizeof(uint16_t));
    }
    offset += face_bytes;
  }
  return bytes;
}

}  // namespace sightline
