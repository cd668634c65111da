// SPDX-License-Identifier: Apache-2.0
// Splits of a set's components by the values of one setting: half of the values are held out.
#pragma once

#include <string>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// One setting, divided in two ways: each component is held out in at most one of them.
struct SettingSplit {
  static constexpr int kHalves = 2;
  // "exposure_time_s", "f_number", "camera_distance_m", "laser_distance_m", "focus_distance_m",
  // "plate position", "time" or "pixels".
  std::string setting;
  std::vector<std::vector<bool>> held_out[kHalves];  // [block][component]
};

// Splits by every setting that varies. Values alternate in their order: every second one is held
// out. Dark frames have an exposure time and a place in time; the other settings say nothing about
// them, and they are not held out there. Time is divided into eight parts of equally many
// recordings. "pixels" holds out every second pair of components of each block.
std::vector<SettingSplit> SplitBySettings(const SetModel& model);

}  // namespace sightline
