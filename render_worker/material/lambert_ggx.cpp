// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "render_worker/material/directional_albedo.h"
#include "render_worker/material/fresnel.h"
#include "render_worker/material/microfacet.h"
#include "render_worker/material/models.h"
#include "render_worker/material/single_precision_pi.h"

namespace sightline {
namespace {

using Eigen::Vector3f;

class Lambert final : public DetailedMaterial {
 public:
  Lambert(Common common, float albedo) : DetailedMaterial(std::move(common)), albedo_(albedo) {}

 protected:
  float FlatBrdf(const Vector3f& /*out*/, const Vector3f& /*in*/,
                 const Scales& scales) const override {
    return std::min(1.0F, albedo_ * scales.albedo) * kInversePi;
  }
  void FlatSpectrum(const Vector3f& /*out*/, const Vector3f& /*in*/, const Scales& scales,
                    Spectrum& brdf) const override {
    for (int i = 0; i < kSpectralBins; ++i) {
      brdf[i] = std::min(1.0F, albedo_ * scales.albedo * common().reflectance[i]) * kInversePi;
    }
  }
  Vector3f FlatSample(const Vector3f& /*out*/, const Scales& /*scales*/, float u1, float u2,
                      float /*u3*/) const override {
    return SampleCosine(u1, u2);
  }
  float FlatPdf(const Vector3f& /*out*/, const Vector3f& in,
                const Scales& /*scales*/) const override {
    return in.z() * kInversePi;
  }

 private:
  float albedo_;
};

class LambertGgx final : public DetailedMaterial {
 public:
  LambertGgx(Common common, float albedo, float specular_f0, float alpha)
      : DetailedMaterial(std::move(common)),
        albedo_(albedo),
        specular_f0_(specular_f0),
        alpha_(alpha) {
    // A height field scales roughness between alpha/2 and 1; one table otherwise.
    const int tables = has_detail() ? kRoughnessTables : 1;
    least_alpha_ = has_detail() ? 0.5F * alpha_ : alpha_;
    for (int i = 0; i < tables; ++i) {
      const float table_alpha =
          tables == 1 ? alpha_
                      : least_alpha_ + (1 - least_alpha_) * static_cast<float>(i) / (tables - 1);
      specular_albedo_.emplace_back([&](float cosine) {
        return GgxDirectionalAlbedo({table_alpha, table_alpha}, cosine, [&](float facet_cosine) {
          return SchlickFresnel(specular_f0_, facet_cosine);
        });
      });
    }
  }

 protected:
  float FlatBrdf(const Vector3f& out, const Vector3f& in, const Scales& scales) const override {
    const float largest = LargestAlbedo(out, in, scales);
    return Sum(out, in, scales) / std::max(1.0F, largest);
  }
  void FlatSpectrum(const Vector3f& out, const Vector3f& in, const Scales& scales,
                    Spectrum& brdf) const override {
    const float sum = Sum(out, in, scales);
    const float largest = LargestAlbedo(out, in, scales);
    for (int i = 0; i < kSpectralBins; ++i) {
      const float reflectance = common().reflectance[i];
      brdf[i] = sum * reflectance / std::max(1.0F, largest * reflectance);
    }
  }
  Vector3f FlatSample(const Vector3f& out, const Scales& scales, float u1, float u2,
                      float u3) const override {
    if (u3 >= SpecularShare(out, scales)) return SampleCosine(u1, u2);
    return ReflectAt(SampleVisibleNormal(Roughness(scales), out, u1, u2), out);
  }
  float FlatPdf(const Vector3f& out, const Vector3f& in, const Scales& scales) const override {
    const float share = SpecularShare(out, scales);
    return share * VisibleNormalReflectionPdf(Roughness(scales), out, in) +
           (1 - share) * in.z() * kInversePi;
  }
  float RoughnessSquared() const override { return alpha_ * alpha_; }

 private:
  static constexpr int kRoughnessTables = 9;

  float Alpha(const Scales& scales) const {
    return scales.roughness == 1 ? alpha_
                                 : std::clamp(alpha_ * scales.roughness, least_alpha_, 1.0F);
  }
  GgxRoughness Roughness(const Scales& scales) const {
    const float alpha = Alpha(scales);
    return {alpha, alpha};
  }
  float Diffuse(const Scales& scales) const { return std::min(1.0F, albedo_ * scales.albedo); }

  float Sum(const Vector3f& out, const Vector3f& in, const Scales& scales) const {
    const float facet_cosine = out.dot((out + in).normalized());
    return Diffuse(scales) * kInversePi +
           SchlickFresnel(specular_f0_, facet_cosine) * GgxReflection(Roughness(scales), out, in);
  }
  float SpecularAlbedo(float cosine, const Scales& scales) const {
    if (specular_albedo_.size() == 1) return specular_albedo_[0].At(cosine);
    const float place = (Alpha(scales) - least_alpha_) / (1 - least_alpha_) *
                        static_cast<float>(specular_albedo_.size() - 1);
    const size_t below = std::min(static_cast<size_t>(place), specular_albedo_.size() - 2);
    const float share = place - static_cast<float>(below);
    return (1 - share) * specular_albedo_[below].At(cosine) +
           share * specular_albedo_[below + 1].At(cosine);
  }
  float LargestAlbedo(const Vector3f& out, const Vector3f& in, const Scales& scales) const {
    return Diffuse(scales) +
           std::max(SpecularAlbedo(out.z(), scales), SpecularAlbedo(in.z(), scales));
  }
  float SpecularShare(const Vector3f& out, const Scales& scales) const {
    const float specular = SpecularAlbedo(out.z(), scales);
    // Never without either: pdf stays positive where the BRDF is.
    return std::clamp(specular / (specular + Diffuse(scales)), 0.1F, 0.9F);
  }

  float albedo_;
  float specular_f0_;
  float alpha_;
  float least_alpha_;
  std::vector<DirectionalAlbedo> specular_albedo_;
};

}  // namespace

std::shared_ptr<const Material> MakeLambert(DetailedMaterial::Common common, float albedo) {
  return std::make_shared<Lambert>(std::move(common), albedo);
}

std::shared_ptr<const Material> MakeLambertGgx(DetailedMaterial::Common common, float albedo,
                                               float specular_f0, float alpha) {
  return std::make_shared<LambertGgx>(std::move(common), albedo, specular_f0, alpha);
}

}  // namespace sightline
