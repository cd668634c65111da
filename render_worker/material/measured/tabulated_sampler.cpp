// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/measured/tabulated_sampler.h"

#include <algorithm>
#include <cmath>

#include "render_worker/material/microfacet.h"
#include "render_worker/material/single_precision_pi.h"

namespace sightline {
namespace {

using Eigen::Vector3f;

// Mean over a cell of the (sin^2, azimuth) square, 3 x 3 points.
float CellMean(const IsotropicBrdf& brdf, float cos_out, int ring, int rings, int sector,
               int sectors) {
  float sum = 0;
  for (int i = 0; i < 3; ++i) {
    const float sin2 =
        (static_cast<float>(ring) + (static_cast<float>(i) + 0.5F) / 3) / static_cast<float>(rings);
    for (int j = 0; j < 3; ++j) {
      const float azimuth = kPi *
                            (static_cast<float>(sector) + (static_cast<float>(j) + 0.5F) / 3) /
                            static_cast<float>(sectors);
      sum += brdf(cos_out, std::sqrt(1 - sin2), azimuth);
    }
  }
  return sum / 9;
}

}  // namespace

TabulatedSampler::TabulatedSampler(const IsotropicBrdf& brdf)
    : weight_(static_cast<size_t>(kViews) * kCells),
      cumulative_(weight_.size()),
      albedo_([&](float cosine) {
        double sum = 0;
        for (int cell = 0; cell < kCells; ++cell) {
          sum += CellMean(brdf, cosine, cell / kSectors, kRings, cell % kSectors, kSectors);
        }
        return static_cast<float>(sum / kCells) * kPi;
      }) {
  for (int view = 0; view < kViews; ++view) {
    const float cos_out =
        std::max(0.004F, std::cos(0.5F * kPi * static_cast<float>(view) / (kViews - 1)));
    float* weight = weight_.data() + static_cast<size_t>(view) * kCells;
    float* cumulative = cumulative_.data() + static_cast<size_t>(view) * kCells;
    double sum = 0;
    for (int cell = 0; cell < kCells; ++cell) {
      weight[cell] = CellMean(brdf, cos_out, cell / kSectors, kRings, cell % kSectors, kSectors);
      sum += weight[cell];
    }
    // A black view is sampled evenly.
    const double mean = sum > 0 ? sum / kCells : 1;
    double running = 0;
    for (int cell = 0; cell < kCells; ++cell) {
      weight[cell] = sum > 0 ? static_cast<float>(weight[cell] / mean) : 1;
      running += weight[cell];
      cumulative[cell] = static_cast<float>(running / kCells);
    }
    cumulative[kCells - 1] = 1;
  }
}

int TabulatedSampler::View(float cosine) {
  const float theta = std::acos(std::clamp(cosine, 0.0F, 1.0F));
  return std::min(static_cast<int>(std::lround(theta / (0.5F * kPi) * (kViews - 1))), kViews - 1);
}

Vector3f TabulatedSampler::Sample(const Vector3f& out, float u1, float u2, float u3) const {
  if (u3 < kCosineShare) return SampleCosine(u1, u2);
  const float* cumulative = cumulative_.data() + static_cast<size_t>(View(out.z())) * kCells;
  // u1 chooses the cell, and its remainder the place in it along the ring.
  const float* found = std::upper_bound(cumulative, cumulative + kCells - 1, u1);
  const int cell = static_cast<int>(found - cumulative);
  const float from = cell > 0 ? cumulative[cell - 1] : 0;
  const float width = cumulative[cell] - from;
  const float remainder = width > 0 ? std::clamp((u1 - from) / width, 0.0F, 0x1.fffffep-1F) : 0.5F;
  const int ring = cell / kSectors;
  const float sin2 = (static_cast<float>(ring) + remainder) / static_cast<float>(kRings);
  // u2 chooses the side and the place in azimuth.
  const bool left = u2 < 0.5F;
  const float place = left ? 2 * u2 : 2 * u2 - 1;
  const float offset = kPi * (static_cast<float>(cell % kSectors) + place) / kSectors;
  const float azimuth = std::atan2(out.y(), out.x()) + (left ? offset : -offset);
  const float radius = std::sqrt(sin2);
  return {radius * std::cos(azimuth), radius * std::sin(azimuth),
          std::sqrt(std::max(0.0F, 1 - sin2))};
}

float TabulatedSampler::Pdf(const Vector3f& out, const Vector3f& in) const {
  const float sin2 = std::clamp(1 - in.z() * in.z(), 0.0F, 1.0F);
  float azimuth = std::abs(std::atan2(in.y(), in.x()) - std::atan2(out.y(), out.x()));
  if (azimuth > kPi) azimuth = 2 * kPi - azimuth;
  const int ring = std::min(static_cast<int>(sin2 * kRings), kRings - 1);
  const int sector = std::min(static_cast<int>(azimuth / kPi * kSectors), kSectors - 1);
  const float weight =
      weight_[(static_cast<size_t>(View(out.z())) * kRings + ring) * kSectors + sector];
  return (kCosineShare + (1 - kCosineShare) * weight) * in.z() / kPi;
}

}  // namespace sightline
