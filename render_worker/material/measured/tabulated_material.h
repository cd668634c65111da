// SPDX-License-Identifier: Apache-2.0
// An isotropic measured BRDF, made energy-conserving.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "render_worker/material/detailed_material.h"
#include "render_worker/material/measured/tabulated_sampler.h"

namespace sightline {

// One reciprocal BRDF per colour channel. If measurements reflect more light than arrives, they are
// divided by max(1, A(out), A(in)) with the directional albedo A, which keeps reciprocity.
class TabulatedMaterial final : public DetailedMaterial {
 public:
  struct Channel {
    IsotropicBrdf brdf;
    Spectrum share;  // of the channel in every bin; the channels' shares sum to 1
    float laser_share = 1;
  };
  TabulatedMaterial(Common common, std::vector<Channel> channels, std::optional<double> scale_m);

  bool grey() const override { return channels_.size() == 1 && DetailedMaterial::grey(); }
  std::optional<double> measured_scale_m() const override;

 protected:
  float FlatBrdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                 const Scales& scales) const override;
  void FlatSpectrum(const Eigen::Vector3f& out, const Eigen::Vector3f& in, const Scales& scales,
                    Spectrum& brdf) const override;
  Eigen::Vector3f FlatSample(const Eigen::Vector3f& out, const Scales& scales, float u1, float u2,
                             float u3) const override;
  float FlatPdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                const Scales& scales) const override;

 private:
  float ChannelBrdf(size_t channel, const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                    float scale) const;

  std::vector<Channel> channels_;
  std::vector<DirectionalAlbedo> albedo_;
  std::unique_ptr<TabulatedSampler> sampler_;
  std::optional<double> scale_m_;
};

}  // namespace sightline
