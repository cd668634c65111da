// SPDX-License-Identifier: Apache-2.0
#include "planner_client/coverage_client/part_upload.h"

#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace sightline {

static_assert(std::endian::native == std::endian::little);

std::string EncodePly(const TriangleMesh& mesh) {
  std::string bytes = absl::StrCat(
      "ply\nformat binary_little_endian 1.0\nelement vertex ", mesh.positions_m.size(),
      "\nproperty float x\nproperty float y\nproperty float z\nelement face ",
      mesh.triangles.size(), "\nproperty list uchar uint vertex_indices\nend_header\n");
  constexpr size_t kVertexBytes = 3 * sizeof(float);
  constexpr size_t kFaceBytes = 1 + 3 * sizeof(uint32_t);
  size_t offset = bytes.size();
  bytes.resize(offset + kVertexBytes * mesh.positions_m.size() +
               kFaceBytes * mesh.triangles.size());
  for (const Eigen::Vector3f& position : mesh.positions_m) {
    std::memcpy(bytes.data() + offset, position.data(), kVertexBytes);
    offset += kVertexBytes;
  }
  for (const auto& triangle : mesh.triangles) {
    bytes[offset] = 3;
    std::memcpy(bytes.data() + offset + 1, triangle.data(), kFaceBytes - 1);
    offset += kFaceBytes;
  }
  return bytes;
}

}  // namespace sightline
