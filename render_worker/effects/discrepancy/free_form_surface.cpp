// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of the surface: light that spreads on the plate, reflectance by
// direction.
#include <array>
#include <cmath>
#include <utility>

#include "render_worker/effects/discrepancy/free_form_effect.h"
#include "render_worker/effects/plate_profile.h"

namespace sightline {
namespace {

// Parts of the light that spread as (1 + |s|/l) exp(-|s|/l)/(4 l), exp(-|s|/l)/(2 l) applied twice,
// with four standard deviations 2 l. Mixtures of these come near kernels both rounder and more
// pointed.
class PlateSpreadTerm final : public FreeFormEffect {
 public:
  PlateSpreadTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.plate_spread",
                        .stage = Stage::kSurface,
                        .summary = "parts of the light spread on the plate, across the line",
                        .reference = "Jensen et al., A practical model for subsurface light "
                                     "transport, SIGGRAPH 2001",
                        .parameters = {Coefficient("fraction_at_0.13_mm", 0.9, 0.1),
                                       Coefficient("fraction_at_0.4_mm", 0.9, 0.1),
                                       Coefficient("fraction_at_1.3_mm", 0.9, 0.05),
                                       Coefficient("fraction_at_4_mm", 0.9, 0.05)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the table is costly
    const double line_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    std::vector<std::pair<double, PlateProfile>> parts;
    double kept = 1;
    for (size_t k = 0; k < kLengths_m.size(); ++k) {
      if (p[k] == 0) continue;
      kept -= p[k];
      parts.emplace_back(p[k],
                         PlateProfile(scene.laser_irradiance_w_m2, frame, scene.constant_along_line,
                                      std::min(line_m, 2 * kLengths_m[k])));
      for (int twice = 0; twice < 2; ++twice)
        parts.back().second.SpreadExponentially(kLengths_m[k]);
    }
    scene.laser_irradiance_w_m2 = [kept, parts = std::move(parts),
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      double sum = kept * before(x_m, s_m);
      for (const auto& [part, profile] : parts) sum += part * profile.At(x_m, s_m);
      return std::max(0.0, sum);
    };
  }

  Axes CurveAxes() const override {
    return {"distance_on_plate_m", "spread_light_per_m", EvenlySpaced(0, 5e-3, 51)};
  }
  double CurveAt(double s_m, Parameters p) const override {
    double sum = 0;
    for (size_t k = 0; k < kLengths_m.size(); ++k) {
      const double t = s_m / kLengths_m[k];
      sum += p[k] * (1 + t) * std::exp(-t) / (4 * kLengths_m[k]);
    }
    return sum;
  }

 private:
  static constexpr std::array<double, 4> kLengths_m = {6.5e-5, 2e-4, 6.5e-4, 2e-3};
};

// The odd part of a spread on the plate: the kernel (1 + t) exp(-t), t = |s|/l, moved by l to one
// side minus the same moved to the other. Light that falls in obliquely leaves a scattering plate
// about a point farther on (Wang and Jacques 1995).
class PlateShiftTerm final : public FreeFormEffect {
 public:
  PlateShiftTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.plate_shift",
                        .stage = Stage::kSurface,
                        .summary = "parts of the light leave the plate on one side of where they "
                                   "fell, not on the other",
                        .reference = "Wang and Jacques, Applied Optics 34 (1995) 2362",
                        .parameters = {Coefficient("fraction_at_0.2_mm", 0.9, 0.05),
                                       Coefficient("fraction_at_0.65_mm", 0.9, 0.05),
                                       Coefficient("fraction_at_2_mm", 0.9, 0.05)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the table is costly
    const double line_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    struct Part {
      double fraction, length_m;
      PlateProfile spread;
    };
    std::vector<Part> parts;
    for (size_t k = 0; k < kLengths_m.size(); ++k) {
      if (p[k] == 0) continue;
      parts.push_back({p[k], kLengths_m[k],
                       PlateProfile(scene.laser_irradiance_w_m2, frame, scene.constant_along_line,
                                    std::min(line_m, kLengths_m[k]))});
      for (int twice = 0; twice < 2; ++twice) {
        parts.back().spread.SpreadExponentially(kLengths_m[k] / 2);
      }
    }
    scene.laser_irradiance_w_m2 = [parts = std::move(parts),
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      double sum = before(x_m, s_m);
      for (const Part& part : parts) {
        sum +=
            0.5 * part.fraction *
            (part.spread.At(x_m, s_m - part.length_m) - part.spread.At(x_m, s_m + part.length_m));
      }
      return std::max(0.0, sum);
    };
  }

 private:
  static constexpr std::array<double, 3> kLengths_m = {2e-4, 6.5e-4, 2e-3};
};

class ReflectanceTerm final : public FreeFormEffect {
 public:
  ReflectanceTerm()
      : FreeFormEffect(
            "multiplicative_light",
            {.id = "unknown.reflectance",
             .stage = Stage::kSurface,
             .summary = "f_r times 1 + a t + b t^2 + c q^2 + d q t + e: t, q tangents along "
                        "the line of the directions to camera and laser",
             .reference = "thesis eq. 4.7 (BRDF)",
             .parameters = {Coefficient("view_slope", 10, 0.2),
                            Coefficient("view_curvature", 30, 0.5),
                            Coefficient("laser_curvature", 30, 0.5),
                            Coefficient("view_laser", 30, 0.5), Coefficient("level", 10, 0.2)}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // the plate stays constant along X
    const double camera = frame.plate.camera_distance_m, laser = frame.plate.laser_distance_m;
    const std::array<double, 4> c = {p[0], p[1], p[2], p[3]};
    if (!IsNull(p.first(4))) scene.constant_along_line = false;
    scene.brdf_per_sr = [=, level = 1 + p[4], before = std::move(scene.brdf_per_sr)](double x_m,
                                                                                     double s_m) {
      const double t = x_m / camera, q = x_m / laser;
      const double factor = level + c[0] * t + c[1] * t * t + c[2] * q * q + c[3] * q * t;
      return std::max(0.0, factor) * before(x_m, s_m);
    };
  }

  Axes CurveAxes() const override {
    return {"view_tangent", "reflectance_factor_on_line_of_sight", EvenlySpaced(-0.35, 0.35, 29)};
  }
  double CurveAt(double t, Parameters p) const override { return 1 + p[4] + t * (p[0] + p[1] * t); }
};

// Random reflectance with rougher and smoother fields than those of one correlation length. It is
// random per place (expectation/texture_law) and changes no expectation.
class ReflectanceScatterTerm final : public FreeFormEffect {
 public:
  ReflectanceScatterTerm()
      : FreeFormEffect(
            "noise",
            {.id = "unknown.reflectance_scatter",
             .stage = Stage::kSurface,
             .kind = EffectKind::kRandomPerPlace,
             .random_law = RandomLaw::kExponentialReflectance,
             .summary = "reflectance across the line scatters by s from place to place, with "
                        "correlation exp(-|distance along the line|/l)",
             .reference = "Rasmussen and Williams, Gaussian Processes for Machine Learning, 4.2.1",
             .parameters = {{"reflectance_scatter_relative", 0, 0, 1, 0.1},
                            {"correlation_length_m", 1e-3, 1e-5, 0.1, 1e-3}}}) {}
};

}  // namespace

std::vector<const FreeFormEffect*> SurfaceTerms() {
  static const PlateSpreadTerm plate_spread;
  static const PlateShiftTerm plate_shift;
  static const ReflectanceTerm reflectance;
  static const ReflectanceScatterTerm reflectance_scatter;
  return {&plate_spread, &plate_shift, &reflectance, &reflectance_scatter};
}

}  // namespace sightline
