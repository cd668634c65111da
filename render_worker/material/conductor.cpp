// SPDX-License-Identifier: Apache-2.0
// Rough metal: GGX facets with the exact Fresnel reflectance of a measured refractive index n + ik.
// Multiple reflection between facets is neglected, so rough metals are slightly too dark (a few per
// cent at alpha 0.4); the diffuse share can compensate for it.
#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/text/number_table.h"
#include "render_worker/material/fresnel.h"
#include "render_worker/material/microfacet.h"
#include "render_worker/material/models.h"
#include "render_worker/material/single_precision_pi.h"

namespace sightline {
namespace {

using Eigen::Vector3f;

struct Index {
  float n;
  float k;
};

Index IndexAt(const RefractiveIndexTable& table, double wavelength_m) {
  const std::vector<double>& x = table.wavelength_m;
  const double place = std::clamp(wavelength_m, x.front(), x.back());
  size_t above = static_cast<size_t>(std::upper_bound(x.begin(), x.end(), place) - x.begin());
  above = std::min(above, x.size() - 1);
  const size_t below = above > 0 ? above - 1 : 0;
  const double share = above == below ? 0 : (place - x[below]) / (x[above] - x[below]);
  return {static_cast<float>(table.n[below] + share * (table.n[above] - table.n[below])),
          static_cast<float>(table.k[below] + share * (table.k[above] - table.k[below]))};
}

class Conductor final : public DetailedMaterial {
 public:
  Conductor(Common common, const RefractiveIndexTable& index, float alpha_x, float alpha_y,
            float diffuse_share, double laser_wavelength_m)
      : DetailedMaterial(std::move(common)),
        laser_index_(IndexAt(index, laser_wavelength_m)),
        alpha_x_(alpha_x),
        alpha_y_(alpha_y),
        diffuse_share_(diffuse_share),
        fresnel_(kKnots) {
    for (int knot = 0; knot < kKnots; ++knot) {
      const float cosine = static_cast<float>(knot) / (kKnots - 1);
      for (int bin = 0; bin < kSpectralBins; ++bin) {
        const Index at_bin = IndexAt(index, BinCentre_m(bin));
        fresnel_[knot][bin] = UnpolarisedFresnel(at_bin.n, at_bin.k, cosine);
      }
    }
  }

  bool grey() const override { return false; }

 protected:
  float FlatBrdf(const Vector3f& out, const Vector3f& in, const Scales& scales) const override {
    const float facet_cosine = out.dot((out + in).normalized());
    const float diffuse = Diffuse(scales);
    return diffuse * kInversePi +
           (1 - diffuse) * UnpolarisedFresnel(laser_index_.n, laser_index_.k, facet_cosine) *
               GgxReflection(Roughness(scales), out, in);
  }
  void FlatSpectrum(const Vector3f& out, const Vector3f& in, const Scales& scales,
                    Spectrum& brdf) const override {
    const float facet_cosine = out.dot((out + in).normalized());
    const float place = std::clamp(facet_cosine, 0.0F, 1.0F) * (kKnots - 1);
    const int below = std::min(static_cast<int>(place), kKnots - 2);
    const float share = place - static_cast<float>(below);
    const float diffuse = Diffuse(scales);
    const float facets = (1 - diffuse) * GgxReflection(Roughness(scales), out, in);
    for (int i = 0; i < kSpectralBins; ++i) {
      const float fresnel = (1 - share) * fresnel_[below][i] + share * fresnel_[below + 1][i];
      brdf[i] = std::min(1.0F, common().reflectance[i]) * (diffuse * kInversePi + facets * fresnel);
    }
  }
  Vector3f FlatSample(const Vector3f& out, const Scales& scales, float u1, float u2,
                      float u3) const override {
    if (u3 < Diffuse(scales)) return SampleCosine(u1, u2);
    return ReflectAt(SampleVisibleNormal(Roughness(scales), out, u1, u2), out);
  }
  float FlatPdf(const Vector3f& out, const Vector3f& in, const Scales& scales) const override {
    const float diffuse = Diffuse(scales);
    return diffuse * in.z() * kInversePi +
           (1 - diffuse) * VisibleNormalReflectionPdf(Roughness(scales), out, in);
  }
  float RoughnessSquared() const override { return alpha_x_ * alpha_y_; }

 private:
  static constexpr int kKnots = 257;

  float Diffuse(const Scales& scales) const {
    return std::min(1.0F, diffuse_share_ * scales.albedo);
  }
  GgxRoughness Roughness(const Scales& scales) const {
    return {std::min(1.0F, alpha_x_ * scales.roughness),
            std::min(1.0F, alpha_y_ * scales.roughness)};
  }

  Index laser_index_;
  float alpha_x_;
  float alpha_y_;
  float diffuse_share_;
  std::vector<Spectrum> fresnel_;  // by cosine
};

}  // namespace

std::shared_ptr<const Material> MakeConductor(DetailedMaterial::Common common,
                                              const RefractiveIndexTable& index, float alpha_x,
                                              float alpha_y, float diffuse_share,
                                              double laser_wavelength_m) {
  return std::make_shared<Conductor>(std::move(common), index, alpha_x, alpha_y, diffuse_share,
                                     laser_wavelength_m);
}

absl::StatusOr<RefractiveIndexTable> ReadRefractiveIndex(const std::string& path,
                                                         const std::string& context) {
  constexpr uint64_t kMaxFileBytes = uint64_t{16} << 20;
  const absl::StatusOr<std::string> bytes = ReadRegularFile(path, kMaxFileBytes);
  if (!bytes.ok()) {
    return absl::Status(bytes.status().code(),
                        absl::StrCat(context, ": ", bytes.status().message()));
  }
  RefractiveIndexTable table;
  const absl::Status status = ReadNumberTable(
      *bytes, {.columns = {"wavelength_nm", "n", "k"}, .comments = true},
      absl::StrCat(context, ": ", path), {}, [&](int, const std::vector<double>& values) {
        table.wavelength_m.push_back(values[0] * 1e-9);
        table.n.push_back(values[1]);
        table.k.push_back(values[2]);
        return absl::OkStatus();
      });
  if (!status.ok()) return status;
  return table;
}

}  // namespace sightline
