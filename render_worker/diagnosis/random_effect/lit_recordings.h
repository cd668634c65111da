// SPDX-License-Identifier: Apache-2.0
// Recordings with laser light, in slots: those of a slot are of different plate positions, so what
// is changed about each of them shows in different entries and can be tried at once.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// `model` must outlive it.
class LitRecordings {
 public:
  explicit LitRecordings(const SetModel& model);

  int count() const { return static_cast<int>(frames_.size()); }
  // Their places among the set's recordings.
  const std::vector<int>& frames() const { return frames_; }
  int slots() const { return slots_; }
  int SlotOf(int recording) const { return slot_[recording]; }
  // Of every entry: the recording of this slot that it is about, as an index into frames(); -1: of
  // none, or of several plate positions.
  std::vector<int> RecordingsOfEntries(int slot) const;

 private:
  const SetModel& model_;
  std::vector<int> frames_, slot_;
  int slots_ = 0;
};

}  // namespace sightline
