// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/quick_set.h"

#include <algorithm>
#include <set>

namespace sightline {
namespace {

// As many as the diagnosis needs.
constexpr size_t kLeastPositions = 4;

// `most` of the indices, evenly spaced, first and last among them.
std::vector<int> Evenly(const std::vector<int>& indices, size_t most) {
  if (indices.size() <= most) return indices;
  std::vector<int> chosen;
  for (size_t k = 0; k < most; ++k) {
    chosen.push_back(indices[most == 1 ? 0 : k * (indices.size() - 1) / (most - 1)]);
  }
  return chosen;
}

}  // namespace

std::vector<int> QuickChoice(const v1::Recordings& recordings) {
  const bool part = recordings.format_version() == 2;
  std::vector<int> laser, dark, ambient;
  for (int i = 0; i < recordings.recordings_size(); ++i) {
    const v1::Recording& recording = recordings.recordings(i);
    if (recording.burst_frame_index() > 0) continue;
    std::vector<int>& kind = recording.kind() == "laser"  ? laser
                             : recording.kind() == "dark" ? dark
                                                          : ambient;
    kind.push_back(i);
  }
  std::vector<int> chosen = Evenly(laser, part ? 3 : 12);
  std::set<int> positions;
  for (const int i : chosen) positions.insert(recordings.recordings(i).plate_position_id());
  for (const int i : laser) {
    if (part || positions.size() >= kLeastPositions) break;
    if (positions.insert(recordings.recordings(i).plate_position_id()).second) chosen.push_back(i);
  }
  for (const std::vector<int>* kind : {&dark, &ambient}) {
    const std::vector<int> some = Evenly(*kind, part ? 1 : 2);
    chosen.insert(chosen.end(), some.begin(), some.end());
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace sightline
