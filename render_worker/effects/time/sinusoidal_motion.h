// SPDX-License-Identifier: Apache-2.0
// Transfer function of an image that moves across the line as A sin(2 pi f t + phase) during its
// exposure: the mean of exp(-2 pi i q displacement) over the exposure. Whole periods give J0(2 pi q
// A); the remaining fraction is summed numerically (Goodman, Introduction to Fourier Optics, 4th
// ed., chapter 7; Lohmann and Paris, Appl. Opt. 4 (1965) 393).
#pragma once

#include <complex>
#include <functional>

namespace sightline {

// Transfer function of frequencies along and across the line [1/m]. `amplitude_m` on the sensor,
// `periods` >= 0 in the exposure, `phase_rad` at its beginning.
std::function<std::complex<double>(double, double)> SinusoidalMotionTransfer(double amplitude_m,
                                                                             double periods,
                                                                             double phase_rad);

}  // namespace sightline
