// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/lit_recordings.h"

#include <algorithm>
#include <map>

namespace sightline {

LitRecordings::LitRecordings(const SetModel& model) : model_(model) {
  std::map<int, int> members;
  const std::vector<RecordedFrame>& frames = model.set().frames;
  for (size_t f = 0; f < frames.size(); ++f) {
    const int id = frames[f].plate_position_id;
    if (id < 0) continue;
    frames_.push_back(static_cast<int>(f));
    slot_.push_back(members[id]++);
    slots_ = std::max(slots_, members[id]);
  }
}

std::vector<int> LitRecordings::RecordingsOfEntries(int slot) const {
  std::map<int, int> recording_of;  // plate position -> index into frames_
  for (int i = 0; i < count(); ++i) {
    if (slot_[i] != slot) continue;
    recording_of[model_.set().frames[frames_[i]].plate_position_id] = i;
  }
  std::vector<int> recordings;
  for (int e = 0; e < model_.blocks(); ++e) {
    const auto recording = recording_of.find(PlatePositionOf(model_, e));
    recordings.push_back(recording == recording_of.end() ? -1 : recording->second);
  }
  return recordings;
}

}  // namespace sightline
