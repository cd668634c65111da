// SPDX-License-Identifier: Apache-2.0
// Dust on the cover glass: Gaussian shadows at random places of the sensor, fixed for a rig; radius
// 2 to 12 px (1/e), 10 to 60 % deep. The count is of the whole sensor; a fraction of a spot is one
// that is less deep, so that the image changes continuously.
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/pixel_pattern.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

struct Spot {
  double column_px, row_px, radius_px, depth;
};

class DustEffect final : public DescribedEffect {
 public:
  DustEffect()
      : DescribedEffect({.id = "optics.dust",
                         .stage = Stage::kOptics,
                         .kind = EffectKind::kRandomPerPixel,
                         .signature = {{"whole_image"}, {"column", "row", "f_number"}},
                         .summary = "dark spots fixed on the sensor",
                         .reference = "EMVA 1288 R4.0 Linear, section 4 (spatial nonuniformity)",
                         .parameters = {{"spots", 0, 0, 1000, 20}}}) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    constexpr double kReach = 4;  // radii: below 1e-7
    std::vector<Spot> spots;
    const uint64_t seed = DeriveSeed(frame.seeds.rig, "dust");
    for (int i = 0; i < p[0]; ++i) {
      CounterRandom random(seed, i);
      Spot spot{(random.Uniform() - 0.5) * frame.sensor.columns_px,
                (random.Uniform() - 0.5) * frame.sensor.rows_px, 2 + 10 * random.Uniform(),
                0.1 + 0.5 * random.Uniform()};
      spot.depth *= std::min(1.0, p[0] - i);
      const double reach = kReach * spot.radius_px;
      if (spot.column_px + reach > light.roi.column_px &&
          spot.column_px - reach < light.roi.column_px + light.roi.columns_px &&
          spot.row_px + reach > light.roi.row_px &&
          spot.row_px - reach < light.roi.row_px + light.roi.rows_px) {
        spots.push_back(spot);
      }
    }
    MultiplyLight(light, false, [&](int column_px, int row_px) {
      double factor = 1;
      for (const Spot& spot : spots) {
        const double x = (column_px - spot.column_px) / spot.radius_px;
        const double y = (row_px - spot.row_px) / spot.radius_px;
        if (x * x + y * y < kReach * kReach) factor *= 1 - spot.depth * std::exp(-x * x - y * y);
      }
      return factor;
    });
  }
};

}  // namespace

const Effect& Dust() {
  static const DustEffect effect;
  return effect;
}

}  // namespace sightline
