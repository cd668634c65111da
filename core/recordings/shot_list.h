// SPDX-License-Identifier: Apache-2.0
// Proposes recordings of a plate that determine what the description of a rig leaves open.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/recordings/recordings.h"

namespace sightline {

inline constexpr int kFewestShots = 12, kMostShots = 500;

struct ShotList {
  RecordingSet set;                // format version 1, uncertainties of an ordinary calibration
  std::vector<std::string> notes;  // assumptions and omissions, for people
};

// About `images` recordings (bursts are not cut) within the inspection's bounds on camera distance
// and triangulation angle: aperture, distance, focus, laser distance and place in the field, each
// with new speckle and exposed so that few pixels of the crest saturate; an exposure sweep and
// repeats in bursts, with the same speckle; dark frames of several exposures, one right after a
// saturated frame; the first setting again and again, over the whole time. INVALID_ARGUMENT names
// `context` and field: no sensor, no lens, `images` outside [12, 500], nothing that can be exposed.
absl::StatusOr<ShotList> PlanShotList(const Inspection& inspection, const std::string& context,
                                      int images);

// The list as text for the person at the rig: how to proceed, then a table (Markdown).
std::string ShotListText(const ShotList& list);

}  // namespace sightline
