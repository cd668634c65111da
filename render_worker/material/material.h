// SPDX-License-Identifier: Apache-2.0
// Interface of surface materials: BRDF, sampling and detail.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/spectrum/spectrum.h"
#include "sightline/v1/material.pb.h"

namespace sightline {

// Effect of a height field at a point of the surface.
struct SurfaceDetail {
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  // in the local frame
  float albedo_scale = 1;
  float roughness_scale = 1;
};

// Columns x, y, z of the local frame of a surface with unit normal z. x is the machining direction
// projected onto the surface, or any tangent if there is no such direction (zero, or along the
// normal). Height-field detail is in this frame: use this function to transform directions into it.
Eigen::Matrix3f LocalFrame(const Eigen::Vector3f& normal,
                           const Eigen::Vector3f& machining_direction);

// An energy-conserving BRDF, reciprocal unless a height field tilts the normal. Directions are unit
// vectors in the local frame (z: normal, x: machining direction), pointing away from the surface;
// the value is 0 if either is below it. Reflected radiance is the integral of Brdf L cos(in), with
// cos against z. For a tilted normal n the value contains the factor n.in / z.in, so that light
// falls on the tilted facet (which is not reciprocal: Veach 1997, section 5.3).
class Material {
 public:
  virtual ~Material() = default;

  // [1/sr] at the laser's wavelength.
  virtual float Brdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                     const SurfaceDetail& detail) const = 0;
  // The same in every bin. Grey materials: equal to Brdf in every bin.
  virtual void BrdfSpectrum(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                            const SurfaceDetail& detail, Spectrum& brdf) const = 0;
  virtual bool grey() const = 0;

  // Samples a direction roughly in proportion to Brdf cos; pdf [1/sr] is exactly Pdf(out, in). pdf
  // 0: no direction.
  struct Sample {
    Eigen::Vector3f in = Eigen::Vector3f::Zero();
    float pdf = 0;
  };
  virtual Sample SampleDirection(const Eigen::Vector3f& out, const SurfaceDetail& detail, float u1,
                                 float u2, float u3) const = 0;
  virtual float Pdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                    const SurfaceDetail& detail) const = 0;

  // Direction of the machining marks in part coordinates; zero: isotropic.
  virtual Eigen::Vector3f machining_direction() const { return Eigen::Vector3f::Zero(); }

  // Normal, albedo and roughness at a point of the part, projected along the largest component of
  // the geometric normal. `footprint_m`: size of one sample there. Without a height field nothing
  // changes.
  virtual SurfaceDetail DetailAt(const Eigen::Vector3f& position_m, const Eigen::Vector3f& normal,
                                 float footprint_m) const = 0;
  virtual bool has_detail() const = 0;

  // Scale [m] at which BRDF and normals were measured, if stated: spot diameter, sample pitch.
  virtual std::optional<double> measured_scale_m() const { return std::nullopt; }
};

// Turns the file names of a material into readable local paths; NOT_FOUND names the file.
using AssetResolver = std::function<absl::StatusOr<std::string>(const std::string& file)>;

// INVALID_ARGUMENT names context, field, value and range (no model, albedo above 1, albedo + F0
// that would create energy, missing machining direction, ...), or the line of a broken table or
// height field. NOT_FOUND for a missing table or height field.
absl::StatusOr<std::shared_ptr<const Material>> MakeMaterial(const v1::Material& message,
                                                             double laser_wavelength_m,
                                                             const AssetResolver& assets,
                                                             const std::string& context);

// Names of the files that a material needs.
std::vector<std::string> MaterialFiles(const v1::Material& message);

// Warning if the footprint of a pixel on the surface [m] and the scale at which BRDF or normals
// were measured differ by more than this factor (thesis 5.3.1, "Scale dependency"): then the image
// resolves roughness that the measurement averaged over, or vice versa. Empty if they agree or if
// the scale is not stated.
inline constexpr double kScaleMismatchFactor = 4;
std::optional<std::string> CheckScale(const Material& material, const std::string& name,
                                      double footprint_m);

}  // namespace sightline
