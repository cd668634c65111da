// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class FocusErrorEffect final : public DescribedEffect {
 public:
  FocusErrorEffect()
      : DescribedEffect(
            {.id = "optics.focus_error",
             .stage = Stage::kOptics,
             .signature = {{"line_core", "line_flanks"}, {"focus_distance_m", "f_number"}},
             .inspection_fields = {{.field = "lens.focus_distance_m", .may_stay_an_effect = true}},
             .summary = "lens focused on another distance: true over set",
             .reference = "thesis eq. 5.5-5.6",
             .parameters = {{"focus_distance_factor", 1, 0.5, 2, 0.05}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.lens.focus_distance_m = frame.lens.focus_distance_m.value() * p[0];
  }
};

}  // namespace

const Effect& FocusError() {
  static const FocusErrorEffect effect;
  return effect;
}

}  // namespace sightline
