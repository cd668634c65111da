// SPDX-License-Identifier: Apache-2.0
// An opaque deposit of radius r in the middle of the stop makes the pupil annular: the light lost
// is (r/R)^2 and grows with the square of the f-number, and what is out of focus has a hollow
// middle. It leaves at least a tenth of the pupil's radius open. Mahajan, Optical Imaging and
// Aberrations, part II (2001), on annular pupils.
#include <algorithm>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class PupilDepositLaw final : public DescribedEffect {
 public:
  PupilDepositLaw()
      : DescribedEffect(
            {.id = "outside.pupil_deposit",
             .stage = Stage::kOptics,
             .signature = {{"line_core", "line_flanks"}, {"f_number", "focus_distance_m"}},
             .summary = "pupil obstructed by a round deposit in its middle",
             .reference = "Mahajan, Optical Imaging and Aberrations, part II (2001)",
             .parameters = {{"deposit_radius_m", 0, 0, 5e-3, 1e-4}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    optics.pupil = [radius = p[0], before = std::move(optics.pupil)](double u_m, double v_m) {
      Pupil pupil = before(u_m, v_m);
      const double most = 0.9 * pupil.radius_m;
      pupil.obstruction_radius_m = std::max(pupil.obstruction_radius_m, std::min(radius, most));
      return pupil;
    };
  }
};

}  // namespace

OutsideLaw PupilDeposit() {
  static const PupilDepositLaw law;
  return {&law, "pupil", {}};
}

}  // namespace sightline::bench
