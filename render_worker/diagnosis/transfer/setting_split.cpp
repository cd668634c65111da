// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/transfer/setting_split.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "render_worker/frame/frame_setup.h"

namespace sightline {
namespace {

// Parts of the duration. Chosen: a slow drift is interpolated from its neighbours, and each part of
// a usual set has several recordings.
constexpr int kPartsOfTime = 8;
// Components of a block that are held out together. Chosen: neighbours in a profile are correlated,
// pairs less so.
constexpr int kComponentsTogether = 2;
// Blocks of fewer components are not divided by pixels.
constexpr int kFewestComponents = 2 * kComponentsTogether;

// Value of a setting in a recording; unset if the setting does not apply to it.
using SettingValue = std::optional<double>;

struct Setting {
  const char* name;
  SettingValue (*of)(const RecordedSet& set, int frame);
};

bool IsDark(const RecordedSet& set, int f) { return set.frames[f].plate_position_id < 0; }

template <double (*of)(const FrameSetup&)>
SettingValue OfLaserFrame(const RecordedSet& set, int f) {
  if (IsDark(set, f)) return std::nullopt;
  return of(set.frames[f].nominal);
}

constexpr Setting kSettings[] = {
    {"exposure_time_s",
     [](const RecordedSet& set, int f) -> SettingValue {
       return set.frames[f].nominal.exposure_time_s;
     }},
    {"f_number", OfLaserFrame<[](const FrameSetup& frame) { return frame.lens.f_number; }>},
    {"camera_distance_m",
     OfLaserFrame<[](const FrameSetup& frame) { return frame.plate.camera_distance_m; }>},
    {"laser_distance_m",
     OfLaserFrame<[](const FrameSetup& frame) { return frame.plate.laser_distance_m; }>},
    {"focus_distance_m",
     OfLaserFrame<[](const FrameSetup& frame) { return frame.lens.focus_distance_m.value_or(0); }>},
    {"plate position",
     [](const RecordedSet& set, int f) -> SettingValue {
       if (IsDark(set, f)) return std::nullopt;
       return set.frames[f].plate_position_id;
     }},
    {"time",
     [](const RecordedSet& set, int f) -> SettingValue {
       return kPartsOfTime * f / static_cast<int>(set.frames.size());
     }},
};

// The half in which every recording is held out; -1: in none. Empty: the setting does not vary.
std::vector<int> HalfOfFrames(const RecordedSet& set, const Setting& setting) {
  std::set<double> values;
  for (int f = 0; f < static_cast<int>(set.frames.size()); ++f) {
    if (const SettingValue value = setting.of(set, f)) values.insert(*value);
  }
  if (values.size() < SettingSplit::kHalves) return {};
  std::vector<int> halves;
  for (int f = 0; f < static_cast<int>(set.frames.size()); ++f) {
    const SettingValue value = setting.of(set, f);
    halves.push_back(value ? static_cast<int>(std::distance(values.begin(), values.find(*value)) %
                                              SettingSplit::kHalves)
                           : -1);
  }
  return halves;
}

// `half_of(block, component)`: the half in which it is held out; -1: in none.
template <typename HalfOf>
SettingSplit MakeSplit(const SetModel& model, const char* name, const HalfOf& half_of) {
  SettingSplit split;
  split.setting = name;
  for (int half = 0; half < SettingSplit::kHalves; ++half) {
    for (int e = 0; e < model.blocks(); ++e) {
      std::vector<bool> held_out;
      for (int k = 0; k < static_cast<int>(model.observed()[e].size()); ++k) {
        held_out.push_back(half_of(e, k) == half);
      }
      split.held_out[half].push_back(std::move(held_out));
    }
  }
  return split;
}

}  // namespace

std::vector<SettingSplit> SplitBySettings(const SetModel& model) {
  std::vector<SettingSplit> splits;
  for (const Setting& setting : kSettings) {
    const std::vector<int> halves = HalfOfFrames(model.set(), setting);
    if (halves.empty()) continue;
    splits.push_back(MakeSplit(model, setting.name, [&](int block, int component) {
      return halves[model.FrameOfComponent(block, component)];
    }));
  }
  splits.push_back(MakeSplit(model, "pixels", [&](int block, int component) {
    if (model.observed()[block].size() < kFewestComponents) return -1;
    return component / kComponentsTogether % SettingSplit::kHalves;
  }));
  return splits;
}

}  // namespace sightline
