// SPDX-License-Identifier: Apache-2.0
// Properties common to all models: height field, grey or coloured reflectance, machining direction.
// The model itself computes a flat surface with scaled albedo and roughness.
#pragma once

#include <memory>

#include "render_worker/material/height_field.h"
#include "render_worker/material/material.h"

namespace sightline {

class DetailedMaterial : public Material {
 public:
  struct Common {
    std::shared_ptr<const HeightField> height_field;  // nullptr: none
    float normal_strength = 1;
    float albedo_contrast = 0;
    float roughness_contrast = 0;
    Spectrum reflectance = {};  // relative to the laser's wavelength
    bool reflectance_is_grey = true;
    Eigen::Vector3f machining_direction = Eigen::Vector3f::Zero();
  };

  float Brdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
             const SurfaceDetail& detail) const final;
  void BrdfSpectrum(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                    const SurfaceDetail& detail, Spectrum& brdf) const final;
  bool grey() const override { return common_.reflectance_is_grey; }
  Sample SampleDirection(const Eigen::Vector3f& out, const SurfaceDetail& detail, float u1,
                         float u2, float u3) const final;
  float Pdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
            const SurfaceDetail& detail) const final;
  Eigen::Vector3f machining_direction() const final { return common_.machining_direction; }
  SurfaceDetail DetailAt(const Eigen::Vector3f& position_m, const Eigen::Vector3f& normal,
                         float footprint_m) const final;
  bool has_detail() const final { return common_.height_field != nullptr; }
  std::optional<double> measured_scale_m() const override;

 protected:
  struct Scales {
    float albedo = 1;
    float roughness = 1;
  };

  explicit DetailedMaterial(Common common) : common_(std::move(common)) {}

  // Both directions must be above the surface.
  virtual float FlatBrdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                         const Scales& scales) const = 0;
  virtual void FlatSpectrum(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                            const Scales& scales, Spectrum& brdf) const = 0;
  virtual Eigen::Vector3f FlatSample(const Eigen::Vector3f& out, const Scales& scales, float u1,
                                     float u2, float u3) const = 0;
  virtual float FlatPdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                        const Scales& scales) const = 0;
  // Squared microfacet roughness, to which slopes finer than the footprint are added; 0: the model
  // has no such parameter.
  virtual float RoughnessSquared() const { return 0; }

  const Common& common() const { return common_; }

 private:
  Common common_;
};

}  // namespace sightline
