// SPDX-License-Identifier: Apache-2.0
// A sensor that is larger than the field of the lithography is exposed block by block and stitched
// together. Blocks differ in the area of their pixels and thus in the light that they collect:
// times 1 + a or 1 - a in blocks of K columns, of which one is centred on the principal point. The
// signs follow the sequence of Thue and Morse, which has no period. Theuwissen, Harvest Imaging
// blog, Butting versus stitching (2016); Smith and Rahmer, Pixel area variation in CCDs and
// implications for precision photometry, Proc. SPIE 7021 (2008).
#include <bit>
#include <cmath>
#include <cstdint>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/pixel_pattern.h"

namespace sightline::bench {
namespace {

class StitchedBlocksLaw final : public DescribedEffect {
 public:
  StitchedBlocksLaw()
      : DescribedEffect(
            {.id = "outside.stitched_blocks",
             .stage = Stage::kSensor,
             .signature = {{"along_line", "whole_image"}, {"column", "field_position"}},
             .finer_than_block = true,
             .summary = "light times 1 + a or 1 - a in blocks of K columns, without a period",
             .reference = "Theuwissen, Harvest Imaging blog, Butting versus stitching (2016); "
                          "Smith and Rahmer, Proc. SPIE 7021 (2008) (area of pixels)",
             .parameters = {{"block_relative", 0, 0, 0.5, 0.01},
                            {"block_columns_px", 64, 8, 2000, 50}}}) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    MultiplyLight(light, false, [&](int column_px, int /*row_px*/) {
      const auto block = static_cast<int32_t>(std::floor(column_px / p[1] + 0.5));
      // Negative numbers count as their two's complement.
      const bool odd = std::popcount(static_cast<uint32_t>(block)) % 2 != 0;
      return odd ? 1 + p[0] : 1 - p[0];
    });
  }
};

}  // namespace

OutsideLaw StitchedBlocks() {
  static const StitchedBlocksLaw law;
  return {&law, "pixel irradiance", {{"block_columns_px", 30, 100}}};
}

}  // namespace sightline::bench
