// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/measured/tabulated_material.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {

using Eigen::Vector3f;

TabulatedMaterial::TabulatedMaterial(Common common, std::vector<Channel> channels,
                                     std::optional<double> scale_m)
    : DetailedMaterial(std::move(common)), channels_(std::move(channels)), scale_m_(scale_m) {
  size_t strongest = 0;
  for (size_t i = 0; i < channels_.size(); ++i) {
    if (channels_[i].laser_share > channels_[strongest].laser_share) strongest = i;
  }
  for (size_t i = 0; i < channels_.size(); ++i) {
    auto sampler = std::make_unique<TabulatedSampler>(channels_[i].brdf);
    albedo_.push_back(sampler->albedo());
    if (i == strongest) sampler_ = std::move(sampler);
  }
}

std::optional<double> TabulatedMaterial::measured_scale_m() const {
  return scale_m_.has_value() ? scale_m_ : DetailedMaterial::measured_scale_m();
}

float TabulatedMaterial::ChannelBrdf(size_t channel, const Vector3f& out, const Vector3f& in,
                                     float scale) const {
  const float crossed = out.x() * in.y() - out.y() * in.x();
  const float along = out.x() * in.x() + out.y() * in.y();
  const float azimuth = std::abs(std::atan2(crossed, along));
  const float largest = std::max(albedo_[channel].At(out.z()), albedo_[channel].At(in.z()));
  return scale * channels_[channel].brdf(out.z(), in.z(), azimuth) /
         std::max(1.0F, scale * largest);
}

float TabulatedMaterial::FlatBrdf(const Vector3f& out, const Vector3f& in,
                                  const Scales& scales) const {
  float sum = 0;
  for (size_t i = 0; i < channels_.size(); ++i) {
    if (channels_[i].laser_share > 0) {
      sum += channels_[i].laser_share * ChannelBrdf(i, out, in, scales.albedo);
    }
  }
  return sum;
}

void TabulatedMaterial::FlatSpectrum(const Vector3f& out, const Vector3f& in, const Scales& scales,
                                     Spectrum& brdf) const {
  brdf.fill(0);
  for (size_t i = 0; i < channels_.size(); ++i) {
    if (common().reflectance_is_grey) {
      const float value = ChannelBrdf(i, out, in, scales.albedo);
      for (int bin = 0; bin < kSpectralBins; ++bin) brdf[bin] += channels_[i].share[bin] * value;
    } else {
      for (int bin = 0; bin < kSpectralBins; ++bin) {
        const float scale = scales.albedo * common().reflectance[bin];
        brdf[bin] += channels_[i].share[bin] * ChannelBrdf(i, out, in, scale);
      }
    }
  }
}

Vector3f TabulatedMaterial::FlatSample(const Vector3f& out, const Scales& /*scales*/, float u1,
                                       float u2, float u3) const {
  return sampler_->Sample(out, u1, u2, u3);
}

float TabulatedMaterial::FlatPdf(const Vector3f& out, const Vector3f& in,
                                 const Scales& /*scales*/) const {
  return sampler_->Pdf(out, in);
}

}  // namespace sightline
