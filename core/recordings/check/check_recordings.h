// SPDX-License-Identifier: Apache-2.0
// Finds bad input before a diagnosis uses it: wrong files, wrong regions, numbers that are not raw,
// recordings that contradict their description.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"
#include "core/status/stop_check.h"

namespace sightline {

// Result of the check of one recording.
struct RecordingState {
  double mean_dn = 0;
  double largest_dn = 0;
  double saturated_fraction = 0;  // of the pixels, at 2^bits - 1
  bool line_found = false;
  std::vector<std::string> remarks;  // errors and warnings about this recording, short
};

// Describes images that hold numbers of fewer bits than the stated bit depth of the camera.
struct NarrowNumbers {
  int bit_depth_bit = 8;
  int repeated_bit = 0;    // upper bits that are repeated below the number, to be shifted out
  double gain_factor = 1;  // gain and black level of these numbers over those described
};

// Messages name file, field and reason.
struct RecordingCheck {
  std::vector<std::string> errors;    // cannot be used
  std::vector<std::string> warnings;  // suspicious, or quantities for which the set is too small
  std::vector<RecordingState> recordings;
  std::vector<int> without_line;        // laser recordings that should show it; among the errors
  std::optional<NarrowNumbers> narrow;  // can be taken as such; among the errors until they are
};

// `raw_dn`: one image for every recording; an empty image could not be read and is skipped.
// Physical effects (a nonlinear response, glare, drift, stuck bits, ...) are not bad input and give
// at most warnings. If `stop` returns an error, ends early with an empty result.
RecordingCheck CheckRecordings(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn,
                               const StopCheck& stop = {});

// Files of 8 bits from a camera that has more: its upper bits.
NarrowNumbers EightBitNumbers(const Sensor& camera);

// Describes the camera by the bits that the numbers have, so that their rounding is in the model,
// and says so as a warning. The set is to be checked again.
std::string TakeNarrowNumbers(const NarrowNumbers& narrow, RecordingSet* set,
                              std::vector<Image<uint16_t>>* raw_dn);

// Removes recordings without a line from a set if they are at most a tenth of its laser recordings
// and in no burst, so that the others can still be used. Returns the omissions with their reasons,
// as warnings; empty: the set is unchanged. The set must be checked again.
std::vector<std::string> LeaveOutWithoutLine(const RecordingCheck& check, RecordingSet* set,
                                             std::vector<Image<uint16_t>>* raw_dn);

}  // namespace sightline
