// SPDX-License-Identifier: Apache-2.0
// Chooses the setting with the best line detection for a group of frames.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/optical_planning/exposure_search.h"
#include "render_worker/optical_planning/setting_judge.h"

namespace sightline {

// Values common to all settings of a group.
struct SettingGroup {
  double image_speed_px_per_m = 0;  // image displacement per travel of the stage
  double travel_m = 0;              // of the scan; 0: a single frame
  double stated_focus_m = 0;        // default focus distance
  std::vector<double> f_numbers;    // to try, ascending
};

// The best result of an f-number, and the trials with its lens setting and laser power.
struct FNumberChoice {
  double f_number = 0;
  std::vector<JudgedSetting> exposures;  // by exposure time; empty: rejected
  size_t best = 0;                       // of these
  std::string refused;                   // reason for the rejection
};

struct SettingChoice {
  std::vector<FNumberChoice> curve;  // by f-number
  size_t best = 0;                   // of the curve
  // The best f-number with and without a freedom, by name.
  struct Alternative {
    std::string name;
    JudgedSetting judged;
  };
  std::vector<Alternative> alternatives;
  // Focus distances tried at the best f-number, each with its best exposure.
  std::vector<JudgedSetting> focus;
  // Best pair of exposures, if it is better than the best single one.
  std::optional<JudgedSetting> pair;
  ExposureLimit limit;

  const JudgedSetting& best_single() const { return curve[best].exposures[curve[best].best]; }
  const JudgedSetting& chosen() const { return pair ? *pair : best_single(); }
};

// True if the cost exceeds that of `best` by at most 1.96 standard errors of the difference.
bool AsGoodAs(const JudgedSetting& judged, const JudgedSetting& best);

// Exposure times for the smallest f-number of the planning: as stated, or a geometric series over
// all frames. It begins where bright points of the line (90th percentile) reach 1/25 of the full
// scale, and ends where dark points (10th percentile) would reach four times the full scale, but at
// most at `limit`.
ExposureGrid MakeExposureGrid(const SettingJudge& judge, const Inspection& inspection,
                              const ExposureLimit& limit);

// Evaluates every f-number with all permitted sensor tilts, focus distances, laser powers and
// exposures. A range of focus distances is sampled at five distances equally spaced in 1/d, in
// which defocus is linear, and at two more next to the best; a range of powers at its ends and
// their geometric mean. `progress` gets non-decreasing fractions in [0, 1], after every strip of an
// image and every few exposures; the judge's own report is disabled at the end.
// FAILED_PRECONDITION, reason EXPOSURE_TOO_LONG: at every f-number, the shortest exposure exceeds
// the limit by the stage's speed or the frame rate. Errors of the judge.
absl::StatusOr<SettingChoice> ChooseSetting(SettingJudge& judge, const Inspection& inspection,
                                            const SettingGroup& group, const ExposureGrid& grid,
                                            const std::function<void(double)>& progress);

}  // namespace sightline
