// SPDX-License-Identifier: Apache-2.0
// Samples directions in proportion to an isotropic BRDF times the cosine, from a table.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "render_worker/material/directional_albedo.h"

namespace sightline {

// Isotropic BRDF of (cos out, cos in, azimuth between them [0, pi]).
using IsotropicBrdf = std::function<float(float cos_out, float cos_in, float azimuth_rad)>;

// For each of 46 view angles, cells of equal projected solid angle weighted with their mean BRDF,
// mixed with a cosine lobe so that the density is positive everywhere.
class TabulatedSampler {
 public:
  explicit TabulatedSampler(const IsotropicBrdf& brdf);

  Eigen::Vector3f Sample(const Eigen::Vector3f& out, float u1, float u2, float u3) const;
  float Pdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in) const;
  // Directional albedo of the BRDF, from the same cells.
  const DirectionalAlbedo& albedo() const { return albedo_; }

 private:
  static constexpr int kViews = 46;
  static constexpr int kRings = 64;    // equal steps of sin^2
  static constexpr int kSectors = 64;  // of the half circle; the other half mirrors it
  static constexpr int kCells = kRings * kSectors;
  static constexpr float kCosineShare = 0.2F;

  static int View(float cosine);

  std::vector<float> weight_;      // of the cells of every view; the mean is 1
  std::vector<float> cumulative_;  // sums of the shares, last 1
  DirectionalAlbedo albedo_;
};

}  // namespace sightline
