// SPDX-License-Identifier: Apache-2.0
#include "render_worker/detectability/exposure_range.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Below this part of a full pixel no line shows: full wells hold a few ten thousand electrons, and
// dark noise is some.
constexpr double kFirstFill = 1.0 / 4096;
constexpr double kShortestTried_s = 1e-8;
// An interval this narrow (in ratio) is known well enough.
constexpr double kNearEnough = 1.05;

}  // namespace

absl::StatusOr<ExposureRange> FindExposureRange(SettingJudge& judge, const Inspection& inspection,
                                                double fill_s, double min_detected_fraction) {
  const double most_clipped = inspection.optics->max_clipped_fraction;
  const auto shows = [&](double time_s) -> absl::StatusOr<bool> {
    const std::array<double, 1> times = {time_s};
    SIGHTLINE_ASSIGN_OR_RETURN(auto judged, judge.Judge(times, inspection.rig.laser.power_w));
    const LineQuality& quality = judged.front().quality.mean();
    return quality.profile_coverage >= min_detected_fraction &&
           quality.clipped_fraction <= most_clipped;
  };
  // Halves the interval between a time that shows the line and one that does not.
  const auto narrow = [&](double showing_s, double other_s) -> absl::StatusOr<double> {
    while (std::max(showing_s / other_s, other_s / showing_s) > kNearEnough) {
      const double middle_s = std::sqrt(showing_s * other_s);
      SIGHTLINE_ASSIGN_OR_RETURN(const auto here, shows(middle_s));
      (here ? showing_s : other_s) = middle_s;
    }
    return showing_s;
  };

  double time_s = std::max(kFirstFill * fill_s, kShortestTried_s);
  double before_s = 0;  // does not show the line; 0: none is known
  auto here = shows(time_s);
  if (here.ok() && *here) {
    // Very low noise: look for a shorter one.
    while (here.ok() && *here && time_s > kShortestTried_s) {
      here = shows(time_s / 2);
      if (!here.ok()) break;
      if (*here) {
        time_s /= 2;
      } else {
        before_s = time_s / 2;
      }
    }
  } else {
    while (here.ok() && !*here && time_s < kLongestTried_s) {
      before_s = time_s;
      time_s *= 2;
      here = shows(time_s);
    }
    if (here.ok() && !*here) return ExposureRange{};
  }
  if (!here.ok()) return here.status();
  ExposureRange range;
  range.shortest_s = time_s;
  if (before_s > 0) {
    SIGHTLINE_ASSIGN_OR_RETURN(range.shortest_s, narrow(time_s, before_s));
  }
  while (time_s < kLongestTried_s) {
    const double longer_s = 2 * time_s;
    SIGHTLINE_ASSIGN_OR_RETURN(const auto longer, shows(longer_s));
    if (!longer) {
      SIGHTLINE_ASSIGN_OR_RETURN(range.longest_s, narrow(time_s, longer_s));
      return range;
    }
    time_s = longer_s;
  }
  return range;
}

}  // namespace sightline
