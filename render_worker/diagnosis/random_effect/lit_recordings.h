// SPDX-License-Identifier: Apache-2.0
// Recordings with laser light, divided into slots: the n-th recordings of all plate positions form
// slot n. Recordings of different positions show in different observation blocks, so a finite
// difference can change all recordings of a slot at once.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// `model` must outlive the recordings.
class LitRecordings {
 public:
  explicit LitRecordings(const SetModel& model);

  int count() const { return static_cast<int>(frames_.size()); }
  // Indices of the recordings in the set.
  const std::vector<int>& frames() const { return frames_; }
  int slots() const { return slots_; }
  int SlotOf(int recording) const { return slot_[recording]; }
  // For every observation block the recording of this slot that it shows, as an index into
  // frames(); -1: the block shows none, or several plate positions.
  std::vector<int> RecordingsOfEntries(int slot) const;

 private:
  const SetModel& model_;
  std::vector<int> frames_, slot_;
  int slots_ = 0;
};

}  // namespace sightline
