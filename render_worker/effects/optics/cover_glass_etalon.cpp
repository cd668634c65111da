// SPDX-License-Identifier: Apache-2.0
// Interference between the faces of the cover glass: straight fringes fixed on the sensor, in laser
// light only (other light is too broad-band). 1 + V cos(2 pi (u cos a + v sin a)/period + phase),
// averaged over the pixel. Each camera has a random phase; the parameter is added to it so that
// recordings of that camera can be matched.
#include <boost/math/special_functions/sinc.hpp>
#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/pixel_pattern.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// Mean of cos(2 pi (place + x t)) over |t| < 1/2, relative to the one at t = 0.
double MeanOverPixel(double x) { return boost::math::sinc_pi(std::numbers::pi * x); }

class CoverGlassEtalonEffect final : public DescribedEffect {
 public:
  CoverGlassEtalonEffect()
      : DescribedEffect(
            {.id = "optics.cover_glass_etalon",
             .stage = Stage::kOptics,
             .start_search = StartSearch::kPeriodogramOfSensor,
             .signature = {{"whole_image", "along_line"}, {"column", "row"}},
             .finer_than_block = true,
             .summary = "fringes of the cover glass, fixed on the sensor: 1 + V cos",
             .reference = "Hecht, Optics, 5th ed., section 9.4.1 (fringes of a thin wedge)",
             .parameters = {{"fringe_visibility", 0, 0, 1, 0.05},
                            {"fringe_period_px", 30, 2, 2000, 30},
                            {"fringe_direction_deg", 0, -180, 180, 90},
                            {"fringe_phase_deg", 0, -360, 360, 180}}}) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    CounterRandom random(DeriveSeed(frame.seeds.camera, "cover glass"), 0);
    const double phase = 2 * std::numbers::pi * (random.Uniform() + p[3] / 360);
    const double direction = p[2] * std::numbers::pi / 180;
    const double along_u = std::cos(direction) / p[1], along_v = std::sin(direction) / p[1];
    const double amplitude = p[0] * MeanOverPixel(along_u) * MeanOverPixel(along_v);
    MultiplyLight(light, true, [&](int column_px, int row_px) {
      const double turns = along_u * column_px + along_v * row_px;
      return 1 + amplitude * std::cos(2 * std::numbers::pi * turns + phase);
    });
  }

  // Fringes of period P at the angle a change by x = pi columns cos(a)/P along the block. Their
  // variance is V^2 / 2, of which the mean over the block keeps (sin(x)/x)^2.
  double VarianceWithinBlock(int columns_px, Parameters p) const override {
    const double x = std::numbers::pi * columns_px / p[1] * std::cos(p[2] * std::numbers::pi / 180);
    const double of_mean = std::abs(x) < 1e-6 ? 1 : std::sin(x) / x;
    return 0.5 * p[0] * p[0] * (1 - of_mean * of_mean);
  }
};

}  // namespace

const Effect& CoverGlassEtalon() {
  static const CoverGlassEtalonEffect effect;
  return effect;
}

}  // namespace sightline
