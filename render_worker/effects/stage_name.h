// SPDX-License-Identifier: Apache-2.0
// Names of the stages of image formation in files and reports.
#pragma once

#include <string_view>

#include "render_worker/effects/effect.h"

namespace sightline {

// "illumination", "surface", "optics", "geometry", "sensor", "time": as in the recordings format.
inline std::string_view StageName(Stage stage) {
  switch (stage) {
    case Stage::kIllumination:
      return "illumination";
    case Stage::kSurface:
      return "surface";
    case Stage::kOptics:
      return "optics";
    case Stage::kGeometry:
      return "geometry";
    case Stage::kSensor:
      return "sensor";
    case Stage::kTime:
      return "time";
  }
  return "";
}

}  // namespace sightline
