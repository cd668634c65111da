// SPDX-License-Identifier: Apache-2.0
// Plate that creeps along the line. The line stays, the scatterers move: by m v t since the start,
// so that recordings of one plate position see displaced speckle, and during the exposure, which
// averages over moments a third of a speckle apart (at most 32 of them).
#include <algorithm>
#include <cmath>
#include <vector>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class PlateMotionEffect final : public DescribedEffect {
 public:
  PlateMotionEffect()
      : DescribedEffect({.id = "time.plate_motion",
                         .stage = Stage::kTime,
                         .signature = {{"speckle"}, {"exposure_time_s"}},
                         .summary = "plate creeps along the line: speckle moves and blurs",
                         .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., section 5.3 "
                                      "(moving diffuser)",
                         .parameters = {{"plate_speed_m_s", 0, -0.1, 0.1, 1e-4}}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup& frame, Parameters p) const override {
    constexpr int kMostMoments = 32;
    if (p[0] == 0) return;  // one moment stays one
    const double b = frame.ImageDistance();
    const double speed = p[0] * b / frame.plate.camera_distance_m;  // in the image
    const double travel = speed * frame.exposure_time_s;
    const double speckle_size = frame.laser.wavelength_m * b / frame.PupilDiameter();
    const int moments = std::clamp(
        1 + static_cast<int>(std::ceil(3 * std::abs(travel) / speckle_size)), 2, kMostMoments);
    std::vector<SpeckleModel::Shift> shifts;
    for (const SpeckleModel::Shift& shift : speckle.shifts) {
      for (int k = 0; k < moments; ++k) {
        const double at = frame.timestamp_s + frame.exposure_time_s * (k + 0.5) / moments;
        shifts.push_back({shift.u_m + speed * at, shift.v_m});
      }
    }
    speckle.shifts = std::move(shifts);
  }
};

}  // namespace

const Effect& PlateMotion() {
  static const PlateMotionEffect effect;
  return effect;
}

}  // namespace sightline
