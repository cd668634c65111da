// SPDX-License-Identifier: Apache-2.0
// Three points of a mount press the lens into a three-leaved shape: W = c sqrt(8) (r/R_0)^3 sin(3
// phi), R_0 = 2 mm, so that a stopped-down lens has the less of it, by the third power. Noll, J.
// Opt. Soc. Am. 66 (1976) 207, term 9; Yoder, Mounting Optics in Optical Instruments, 2nd ed.
// (2008), for strain by mounts.
#include <cstddef>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class MountTrefoilLaw final : public DescribedEffect {
 public:
  MountTrefoilLaw()
      : DescribedEffect({.id = "outside.mount_trefoil",
                         .stage = Stage::kOptics,
                         .signature = {{"line_flanks", "line_core"}, {"f_number"}},
                         .summary = "trefoil wavefront error of a lens strained at three points",
                         .reference = "Noll, J. Opt. Soc. Am. 66 (1976) 207; Yoder, Mounting "
                                      "Optics in Optical Instruments, 2nd ed. (2008)",
                         .parameters = {{"trefoil_waves", 0, -20, 20, 0.3}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    optics.pupil = [rms_m = p[0] * optics.wavelength_m, before = std::move(optics.pupil)](
                       double u_m, double v_m) {
      constexpr size_t kTrefoil = 9;  // Noll's index
      Pupil pupil = before(u_m, v_m);
      if (pupil.zernike_m.size() < kTrefoil) pupil.zernike_m.resize(kTrefoil);
      const double ratio = pupil.radius_m / 2e-3;
      pupil.zernike_m[kTrefoil - 1] += rms_m * ratio * ratio * ratio;
      return pupil;
    };
  }
};

}  // namespace

OutsideLaw MountTrefoil() {
  static const MountTrefoilLaw law;
  return {&law, "pupil", {}};
}

}  // namespace sightline::bench
