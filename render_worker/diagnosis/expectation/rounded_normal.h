// SPDX-License-Identifier: Apache-2.0
// Moments of a normal variable after rounding to integers. If its standard deviation is above 0.7
// of a step, rounding only adds a variance of 1/12, with an error below 10^-4 (the first term of
// the Fourier series of the rounding error is exp(-2 pi^2 sigma^2) / pi; Widrow and Kollar,
// Quantization Noise, 2008, chapter 4). Below it, as in 8-bit data of quiet cameras, mean, variance
// and kurtosis depend on the position of the mean between two integers.
#pragma once

namespace sightline {

struct RoundedMoments {
  double mean = 0, variance = 0;
  double excess_kurtosis = 0;
};

// True if the moments differ from those of the normal variable with step^2/12 added. `step_dn`:
// step of the raw values, 1 or, if lowest bits are missing, a power of 2.
bool IsCoarselyRounded(double standard_deviation_dn, int step_dn = 1);

// Moments of max(0, round(X)) cut to the next lower multiple of `step_dn`, X normal with `mean_dn`
// and `standard_deviation_dn` > 0.
RoundedMoments MomentsAfterRounding(double mean_dn, double standard_deviation_dn, int step_dn = 1);

}  // namespace sightline
