// SPDX-License-Identifier: Apache-2.0
// A set of recordings in memory, as input of the diagnosis.
#pragma once

#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

struct RecordedFrame {
  FrameSetup nominal;          // as stated by the set
  int plate_position_id = -1;  // -1: dark frame
  int repeat_group = -1;
  Image<uint16_t> raw_dn;  // empty: the set is only planned
};

struct RecordedSet {
  RecordingSet description;           // format version 1
  std::vector<RecordedFrame> frames;  // of description.recordings, in order of time
};

// The frame read out just before frame f of a burst, with the same region; -1: none.
int PrecedingFrame(const RecordedSet& set, int f);

// True for one plate position through the same optics: both have identical speckle.
bool SameSpeckle(const RecordedFrame& a, const RecordedFrame& b);

// `raw_dn`: one image of its region's size for every recording, or no images at all.
RecordedSet MakeRecordedSet(RecordingSet description, std::vector<Image<uint16_t>> raw_dn);

// Relative power deviation for a fitted number. They are equal if the power is stated. Otherwise (a
// relative uncertainty of 1 or more), numbers d below 0 stand for the factor 1/(1 - d), so that the
// power stays positive and every number changes it.
double PowerDeviation(const SetupDeviation& uncertainty, double power_relative);

// Frame `index` with these deviations (true minus nominal; line_position_each_px is the shift of
// its plate position). Unphysical deviations are clamped: f-number, distances and powers stay above
// a tenth of nominal.
FrameSetup DeviatedFrame(const RecordedSet& set, int index, const SetupDeviation& deviation);

// Number of quantities of a SetupDeviation without line_position_each_px, in the struct's order.
inline constexpr int kDeviations = 17;
// Names as in recordings.json's `uncertainty`. The incidence angle is in radians here.
extern const char* const kDeviationNames[kDeviations];
double& DeviationAt(SetupDeviation& deviation, int index);

}  // namespace sightline
