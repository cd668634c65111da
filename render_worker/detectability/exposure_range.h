// SPDX-License-Identifier: Apache-2.0
// The exposure times that show the laser line, by simulated images of increasing exposure.
#pragma once

#include "absl/status/statusor.h"
#include "core/detectability/detectability.h"
#include "render_worker/optical_planning/setting_judge.h"

namespace sightline {

// Exposure times beyond which a line counts as never shown, or never too bright: those that an
// inspection may state at all.
inline constexpr double kLongestTried_s = 100;

// An exposure shows the line if at least `min_detected_fraction` of it is found within three prior
// uncertainties of its place, and at most optics.max_clipped_fraction of that is clipped. Doubles
// the time from far below what fills a pixel of the line, then halves the interval (in ratio) to 5
// %. The judge looks through `lens` already; `fill_s`: about the time that fills a pixel of the
// line. CANCELLED, and errors of the judge.
absl::StatusOr<ExposureRange> FindExposureRange(SettingJudge& judge, const Inspection& inspection,
                                                double fill_s, double min_detected_fraction);

}  // namespace sightline
