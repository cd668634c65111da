// Bad input recognised before anything is concluded from it: wrong files, wrong regions, numbers
// that are not raw, recordings that are not what they are said to be.
#pragma once

#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"

namespace sightline {

// What a look at one recording says.
struct RecordingState {
  double mean_dn = 0;
  double largest_dn = 0;
  double saturated_fraction = 0;  // of the pixels, at 2^bits - 1
  bool line_found = false;
  std::vector<std::string> remarks;  // errors and warnings about this recording, short
};

// Messages name file, field and reason.
struct RecordingCheck {
  std::vector<std::string> errors;    // cannot be used
  std::vector<std::string> warnings;  // suspicious, or what the set is too small to say
  std::vector<RecordingState> recordings;
  std::vector<int> without_line;  // laser recordings that should show it; among the errors
};

// `raw_dn`: one image for every recording; an empty one could not be read and is passed over.
// Physical effects (a bent response, glare, drift, stuck bits, ...) are no bad input: at most
// warnings.
RecordingCheck CheckRecordings(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn);

// Takes recordings without a line out of a set if they are at most a tenth of its laser recordings
// and in no burst, so that the others can still be used. What was left out and why, as warnings;
// none: nothing was changed. The set is to be checked again.
std::vector<std::string> LeaveOutWithoutLine(const RecordingCheck& check, RecordingSet* set,
                                             std::vector<Image<uint16_t>>* raw_dn);

}  // namespace sightline
