// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/directional_albedo.h"

#include <algorithm>
#include <cmath>

namespace sightline {

DirectionalAlbedo::DirectionalAlbedo(const std::function<float(float cosine)>& albedo_at)
    : values_(kKnots) {
  for (int i = 0; i < kKnots; ++i) {
    values_[i] = albedo_at(std::max(0.004F, static_cast<float>(i) / (kKnots - 1)));
  }
}

float DirectionalAlbedo::At(float cosine) const {
  const float place = std::clamp(cosine, 0.0F, 1.0F) * (kKnots - 1);
  const int below = std::min(static_cast<int>(place), kKnots - 2);
  const float share = place - static_cast<float>(below);
  return values_[below] + share * (values_[below + 1] - values_[below]);
}

float DirectionalAlbedo::Largest() const {
  return *std::max_element(values_.begin(), values_.end());
}

float GgxDirectionalAlbedo(const GgxRoughness& roughness, float cosine,
                           const std::function<float(float facet_cosine)>& fresnel) {
  constexpr int kSteps = 48;
  const Eigen::Vector3f out(std::sqrt(std::max(0.0F, 1 - cosine * cosine)), 0, cosine);
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const Eigen::Vector3f half =
          SampleVisibleNormal(roughness, out, (static_cast<float>(i) + 0.5F) / kSteps,
                              (static_cast<float>(j) + 0.5F) / kSteps);
      const Eigen::Vector3f in = ReflectAt(half, out);
      if (in.z() <= 0) continue;
      sum += fresnel(out.dot(half)) * GgxMaskingShadowing(roughness, out, in) /
             GgxMasking(roughness, out);
    }
  }
  return static_cast<float>(sum / (kSteps * kSteps));
}

}  // namespace sightline
