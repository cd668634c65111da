// SPDX-License-Identifier: Apache-2.0
#include "core/part/mesh.h"

#include <openssl/evp.h>

#include <bit>
#include <cassert>
#include <cstddef>

namespace sightline {
namespace {

// Collects little-endian 32-bit words and hashes them in blocks.
class WordHash {
 public:
  WordHash() : context_(EVP_MD_CTX_new()) {
    [[maybe_unused]] const int ok = EVP_DigestInit_ex(context_, EVP_sha256(), nullptr);
    assert(ok == 1);
  }
  ~WordHash() { EVP_MD_CTX_free(context_); }
  WordHash(const WordHash&) = delete;
  WordHash& operator=(const WordHash&) = delete;

  void Add(uint32_t word) {
    for (int shift = 0; shift < 32; shift += 8) {
      buffer_[used_++] = static_cast<unsigned char>(word >> shift);
    }
    if (used_ == sizeof(buffer_)) Flush();
  }
  std::string Hex() {
    Flush();
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_, digest, &size);
    std::string hex;
    for (unsigned int i = 0; i < size; ++i) {
      hex += "0123456789abcdef"[digest[i] >> 4];
      hex += "0123456789abcdef"[digest[i] & 15];
    }
    return hex;
  }

 private:
  void Flush() {
    EVP_DigestUpdate(context_, buffer_, used_);
    used_ = 0;
  }
  EVP_MD_CTX* context_;
  unsigned char buffer_[1 << 14];
  size_t used_ = 0;
};

}  // namespace

Eigen::AlignedBox3d TriangleMesh::BoundingBox() const {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& position : positions_m) box.extend(position.cast<double>());
  return box;
}

Eigen::Vector3d TriangleMesh::Normal(size_t t) const {
  const Eigen::Vector3d a = Corner(t, 0);
  const Eigen::Vector3d n = (Corner(t, 1) - a).cross(Corner(t, 2) - a);
  const double length = n.norm();
  return length > 0 ? Eigen::Vector3d(n / length) : Eigen::Vector3d::Zero();
}

double TriangleMesh::Area(size_t t) const {
  const Eigen::Vector3d a = Corner(t, 0);
  return 0.5 * (Corner(t, 1) - a).cross(Corner(t, 2) - a).norm();
}

std::string PartDigest(const TriangleMesh& mesh) {
  WordHash hash;
  const uint64_t count = mesh.positions_m.size();
  hash.Add(static_cast<uint32_t>(count));
  hash.Add(static_cast<uint32_t>(count >> 32));
  for (const Eigen::Vector3f& position : mesh.positions_m) {
    for (int axis = 0; axis < 3; ++axis) hash.Add(std::bit_cast<uint32_t>(position[axis]));
  }
  for (const auto& triangle : mesh.triangles) {
    for (uint32_t index : triangle) hash.Add(index);
  }
  return hash.Hex();
}

}  // namespace sightline
