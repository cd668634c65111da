// SPDX-License-Identifier: Apache-2.0
// Target points on a part and bit sets over them.
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sightline {

// Box in part coordinates in which targets have another spacing, or the surface is to be known to
// another lateral resolution.
struct TargetRegion {
  std::string name;
  Eigen::Vector3d min_m;
  Eigen::Vector3d max_m;
  double spacing_m;
  std::optional<double> resolution_m = std::nullopt;  // unset: that of the uncertainty model
};

// Directions in which the visibility of targets is tabulated (48 x 48): more changed the error of
// gain estimates no further on the example part.
inline constexpr int kDefaultFieldDirections = 2304;

struct TargetSampling {
  double spacing_m = 0.005;
  double coverage_radius_m = 0.003;
  double max_normal_angle_rad = 0.52359877559829882;  // 30 degrees
  int64_t seed = 1;
  std::vector<TargetRegion> regions;
  std::optional<double> max_pixel_footprint_m;
  std::optional<double> max_circle_of_confusion_px;
  std::optional<double> max_depth_per_pixel_m;
  // Between the surface's normal and the directions to camera and laser; unset: 90 degrees.
  std::optional<double> max_incidence_rad;
};

// Structure of arrays, all of one length; part coordinates.
struct TargetSet {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<Eigen::Vector3f> normals;
  std::vector<int32_t> regions;     // index into TargetSampling::regions, -1: none
  std::vector<uint32_t> triangles;  // the triangle each target lies on

  size_t size() const { return positions_m.size(); }
};

// Fixed-size bit set; bit i of word i/64.
class TargetBits {
 public:
  TargetBits() = default;
  explicit TargetBits(size_t size) : size_(size), words_((size + 63) / 64, 0) {}

  size_t size() const { return size_; }
  bool Test(size_t i) const { return (words_[i / 64] >> (i % 64)) & 1; }
  void Set(size_t i) { words_[i / 64] |= uint64_t{1} << (i % 64); }
  void Reset(size_t i) { words_[i / 64] &= ~(uint64_t{1} << (i % 64)); }
  int64_t Count() const;
  std::vector<uint64_t>& words() { return words_; }
  const std::vector<uint64_t>& words() const { return words_; }

  TargetBits& operator|=(const TargetBits& other);
  TargetBits& operator&=(const TargetBits& other);
  // Removes the bits of `other`.
  TargetBits& Subtract(const TargetBits& other);
  // Number of bits set here and not in `covered`.
  int64_t CountNotIn(const TargetBits& covered) const;
  friend bool operator==(const TargetBits&, const TargetBits&) = default;

  // Little-endian bytes, (size + 7) / 8 of them: the form on the wire.
  std::string ToBytes() const;
  // Shorter input is padded with zeros; bits beyond `size` are dropped.
  static TargetBits FromBytes(size_t size, const std::string& bytes);

 private:
  size_t size_ = 0;
  std::vector<uint64_t> words_;
};

}  // namespace sightline
