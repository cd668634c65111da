// SPDX-License-Identifier: Apache-2.0
// A step of the optical path at the line lens, a scratch or a roof edge, diffracts: with phi the
// step of the phase, U the field behind a straight edge, w = angle sqrt(2 z/lambda) and z the
// distance of the edge from the virtual source of the fan, the irradiance is |U(w) + exp(i phi)
// (1 - U(w))|^2 times that of the even lens. Fringes get finer away from the edge. Born and Wolf,
// Principles of Optics, 7th ed., section 8.7 (straight edge); Fresnel's integrals after Abramowitz
// and Stegun 7.3.32 and 7.3.33 (error 0.002).
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

// Field of a plane wave behind the edge of an opaque half plane, 0 far in the shadow, 1 far
// outside.
std::complex<double> BehindEdge(double w) {
  const double x = std::abs(w);
  const double f = (1 + 0.926 * x) / (2 + 1.792 * x + 3.104 * x * x);
  const double g = 1 / (2 + 4.142 * x + 3.492 * x * x + 6.670 * x * x * x);
  const double c = std::cos(std::numbers::pi / 2 * x * x);
  const double s = std::sin(std::numbers::pi / 2 * x * x);
  // In the shadow (1/2 - C) + i (1/2 - S), over 1 + i; the lit side is 1 minus that.
  const std::complex<double> shadow =
      std::complex<double>(g * c - f * s, f * c + g * s) / std::complex<double>(1, 1);
  return w < 0 ? shadow : 1.0 - shadow;
}

class LensEdgeDiffractionLaw final : public DescribedEffect {
 public:
  LensEdgeDiffractionLaw()
      : DescribedEffect({.id = "outside.lens_edge_diffraction",
                         .stage = Stage::kIllumination,
                         .signature = {{"along_line"}, {"column", "field_position"}},
                         .summary = "Fresnel fringes of a phase step at the line lens",
                         .reference = "Born and Wolf, Principles of Optics, 7th ed., section 8.7 "
                                      "(Fresnel diffraction at a straight edge)",
                         .parameters = {{"phase_step_rad", 0, 0, 3.1, 0.3},
                                        {"edge_angle_deg", 0.5, -20, 20, 2},
                                        {"edge_distance_m", 1e-3, 1e-5, 0.1, 1e-3}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double edge = std::tan(p[1] * std::numbers::pi / 180);
    const double per_angle = std::sqrt(2 * p[2] / frame.laser.wavelength_m);
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 =
        [=, step = std::polar(1.0, p[0]), distance = frame.plate.laser_distance_m,
         before = std::move(scene.laser_irradiance_w_m2)](double x_m, double s_m) {
          const std::complex<double> u = BehindEdge(per_angle * (x_m / distance - edge));
          return std::norm(u + step * (1.0 - u)) * before(x_m, s_m);
        };
  }
};

}  // namespace

OutsideLaw LensEdgeDiffraction() {
  static const LensEdgeDiffractionLaw law;
  return {&law, "source", {{"edge_angle_deg", -2.5, 2.5, false}, {"edge_distance_m", 3e-4, 2e-3}}};
}

}  // namespace sightline::bench
