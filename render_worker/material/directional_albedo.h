// SPDX-License-Identifier: Apache-2.0
// Fraction of light from one direction that a surface reflects, as a function of the cosine.
#pragma once

#include <functional>
#include <vector>

#include "render_worker/material/microfacet.h"

namespace sightline {

// Linear between equidistant cosines in [0, 1].
class DirectionalAlbedo {
 public:
  // `albedo_at(cosine)`; called for cosines of at least 0.004.
  explicit DirectionalAlbedo(const std::function<float(float cosine)>& albedo_at);

  float At(float cosine) const;
  float Largest() const;

 private:
  static constexpr int kKnots = 65;
  std::vector<float> values_;
};

// Directional albedo of a GGX surface with a Fresnel factor that depends on the facet's cosine, by
// quadrature over visible normals (exact in the limit of many points: here 48 x 48).
float GgxDirectionalAlbedo(const GgxRoughness& roughness, float cosine,
                           const std::function<float(float facet_cosine)>& fresnel);

}  // namespace sightline
