// SPDX-License-Identifier: Apache-2.0
// Values by the definitions of EMVA 1288 R4.0 from the pairs of frames of a sensor set, and the
// signal at which the camera saturates.
#pragma once

#include <optional>
#include <string>

#include "render_worker/sensor/emva1288_measurement.h"
#include "render_worker/sensor_diagnosis/sensor_frames.h"

namespace sightline {

struct Saturation {
  bool reached = false;  // false: no step saturates
  // Mean signal of the step of largest variance; if nothing saturates, 12 % above the largest
  // signal [DN].
  double signal_dn = 0;
};

// Saturation by the largest temporal variance (clause 6.6): reached if brighter steps have less
// noise, or if most pixels of a step are clipped.
Saturation FindSaturation(const FlatFieldSteps& steps);

struct StandardValues {
  std::optional<PhotonTransfer> transfer;   // clauses 6.6 to 6.9
  std::optional<DarkCurrent> dark_current;  // clause 7.1
  std::string warning;                      // reason why `transfer` is unset; empty if it is set
};

StandardValues MeasureByStandard(const FlatFieldSteps& steps);

}  // namespace sightline
