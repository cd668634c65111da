// SPDX-License-Identifier: Apache-2.0
// Centre of one bright line in a profile of values at integer places.
#pragma once

#include <optional>
#include <span>

namespace sightline {

// Search window in profile coordinates; sample i covers [i - 1/2, i + 1/2].
struct ProfileWindow {
  double lower = 0, upper = 0;  // borders the window must not cross
  double start = 0;             // about the centre
  double half_width = 0;        // of the window about the centre
};

struct ProfileCentre {
  double place = 0;
  double peak = 0;   // above the background
  double width = 0;  // standard deviation
};

// Background of a window: median of the values up to one half width outside it on both sides, if
// at least four lie inside the borders; else the least value of window and surroundings.
double LocalBackground(std::span<const double> profile, const ProfileWindow& window);

// Centre of gravity of profile - background in a window centred on the result; the borders may make
// the window narrower than `half_width` (thesis eq. A.7 with sub-pixel ends). Empty: no light, or
// the borders leave less than a pixel on a side.
std::optional<ProfileCentre> CentreOfGravity(std::span<const double> profile,
                                             const ProfileWindow& window, double background);

// Least-squares Gaussian on a constant background (Levenberg and Marquardt), started from the
// weighted log-parabola (Guo, IEEE Signal Processing Magazine 28(5), 2011). Values from
// `saturation` on (<= 0: none) count only where the Gaussian stays below it. Empty: less than five
// values, or no convergence to a bright line inside the window.
std::optional<ProfileCentre> FitGaussian(std::span<const double> profile,
                                         const ProfileWindow& window, double saturation);

}  // namespace sightline
