// SPDX-License-Identifier: Apache-2.0
// A set of recordings in memory, as the diagnosis looks at it.
#pragma once

#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

struct RecordedFrame {
  FrameSetup nominal;          // as the set states it
  int plate_position_id = -1;  // -1: dark frame
  int repeat_group = -1;
  Image<uint16_t> raw_dn;  // empty: the set is planned, not recorded yet
};

struct RecordedSet {
  RecordingSet description;           // format version 1
  std::vector<RecordedFrame> frames;  // of description.recordings, in order of time
};

// The frame that was read out just before frame f of a burst, of the same region; -1: none.
int PrecedingFrame(const RecordedSet& set, int f);

// True for one place of the plate through the same optics: pixel by pixel the same speckle.
bool SameSpeckle(const RecordedFrame& a, const RecordedFrame& b);

// `raw_dn`: one image for every recording, of its region's size; or none at all.
RecordedSet MakeRecordedSet(RecordingSet description, std::vector<Image<uint16_t>> raw_dn);

// Deviation of the power that a fitted number stands for: itself; where the power is not stated (a
// relative uncertainty of 1 or more), numbers d below 0 stand for the factor 1/(1 - d), so that the
// power stays positive and every number changes it.
double PowerDeviation(const SetupDeviation& uncertainty, double power_relative);

// Frame `index` as it would be with these deviations (true minus nominal; line_position_each_px is
// the shift of its plate position). Deviations that make no sense are cut: f-number, distances and
// powers stay above a tenth of nominal.
FrameSetup DeviatedFrame(const RecordedSet& set, int index, const SetupDeviation& deviation);

// The quantities of a SetupDeviation but line_position_each_px, in the order of the struct.
inline constexpr int kDeviations = 17;
// Names as in recordings.json's `uncertainty`. The incidence angle is in radians here.
extern const char* const kDeviationNames[kDeviations];
double& DeviationAt(SetupDeviation& deviation, int index);

}  // namespace sightline
