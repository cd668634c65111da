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

// Splits by every setting that varies. Every second value in ascending order is held out. Dark
// frames only have an exposure time and a time; for other settings they are not held out. Time is
// divided into eight parts with equally many recordings. "pixels" holds out every second pair of
// components of each block.
std::vector<SettingSplit> SplitBySettings(const SetModel& model);

}  // namespace sightline
