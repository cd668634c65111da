// SPDX-License-Identifier: Apache-2.0
// Light that enters a turbid plate obliquely leaves about a point ahead of where it entered: part
// f of the light is spread as exp(-|s - D|/l)/(2 l), D the shift of the diffuse centre. No light
// is lost. Wang and Jacques, Applied Optics 34 (1995) 2362, for the shift.
#include <cmath>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class ObliqueSubsurfaceLaw final : public DescribedEffect {
 public:
  ObliqueSubsurfaceLaw()
      : DescribedEffect({.id = "outside.oblique_subsurface",
                         .stage = Stage::kSurface,
                         .signature = {{"line_flanks", "line_position"}, {"camera_distance_m"}},
                         .summary = "part f of the light leaves the plate about a point shifted by "
                                    "D: exp(-|s - D|/l)/(2 l)",
                         .reference = "Wang and Jacques, Applied Optics 34 (1995) 2362",
                         .parameters = {{"scattered_fraction", 0, 0, 1, 0.1},
                                        {"shift_m", 5e-4, 0, 1e-2, 5e-4},
                                        {"spread_m", 4e-4, 1e-5, 1e-2, 4e-4}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    scene.laser_irradiance_w_m2 = [f = p[0], shift = p[1], spread = p[2],
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      // Equally likely places of exit, in the middle of each quantile of the kernel.
      constexpr int kPlaces = 48;
      double sum = 0;
      for (int i = 0; i < kPlaces; ++i) {
        const double u = (i + 0.5) / kPlaces;
        const double q = u < 0.5 ? std::log(2 * u) : -std::log(2 * (1 - u));
        sum += before(x_m, s_m - shift - spread * q);
      }
      return (1 - f) * before(x_m, s_m) + f * sum / kPlaces;
    };
  }
};

}  // namespace

OutsideLaw ObliqueSubsurface() {
  static const ObliqueSubsurfaceLaw law;
  return {&law, "plate", {{"shift_m", 3e-4, 1.2e-3}, {"spread_m", 1.5e-4, 6e-4}}};
}

}  // namespace sightline::bench
