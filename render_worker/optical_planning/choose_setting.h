// SPDX-License-Identifier: Apache-2.0
// Chooses the setting with which a group of frames is detected best.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/optical_planning/exposure_search.h"
#include "render_worker/optical_planning/setting_judge.h"

namespace sightline {

// Values that all settings of a group share.
struct SettingGroup {
  double image_speed_px_per_m = 0;  // of the image per travel of the stage
  double travel_m = 0;              // of the scan; 0: a single frame
  double stated_focus_m = 0;        // default focus distance
  std::vector<double> f_numbers;    // to try, ascending
};

// The best result of an f-number, and the trials with its lens setting and laser power.
struct FNumberChoice {
  double f_number = 0;
  std::vector<JudgedSetting> exposures;  // by exposure time; empty: refused
  size_t best = 0;                       // of these
  std::string refused;                   // why
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

// Its cost exceeds that of `best` by no more than 1.96 standard errors of the difference.
bool AsGoodAs(const JudgedSetting& judged, const JudgedSetting& best);

// Exposure times for the planning's smallest f-number: as stated, or from where bright places of
// the line (one in ten is brighter) reach a 25th of what the sensor holds to where dark ones (one
// in ten is darker) would hold four times as much, over all frames, at most what `limit` allows, in
// equal ratios.
ExposureGrid MakeExposureGrid(const SettingJudge& judge, const Inspection& inspection,
                              const ExposureLimit& limit);

// Every f-number, and for each sensor tilts, focus distances, laser powers and exposures as far as
// they may vary. A range of focus distances is tried at five distances equally spaced in 1/d, along
// which defocus is linear, and twice more beside the best; a range of powers at its ends and their
// geometric mean. `progress` is called with fractions in [0, 1] that never fall, after every strip
// of an image and every few exposures; the judge's own report is turned off at the end.
// FAILED_PRECONDITION, reason EXPOSURE_TOO_LONG: the shortest exposure is longer than the stage's
// speed or the frame rate allow, at every f-number. Errors of the judge.
absl::StatusOr<SettingChoice> ChooseSetting(SettingJudge& judge, const Inspection& inspection,
                                            const SettingGroup& group, const ExposureGrid& grid,
                                            const std::function<void(double)>& progress);

}  // namespace sightline
