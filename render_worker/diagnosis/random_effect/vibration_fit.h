// SPDX-License-Identifier: Apache-2.0
// A vibration of the image, A sin(2 pi f t + phase) with a random phase for every recording,
// displaces and blurs each of them. Both follow from the phase, so they are not normal, and the
// blur is small where the displacement is large. Amplitude and frequency are those with the largest
// likelihood of all displacements and blurs.
#pragma once

#include <span>

namespace sightline {

// Movement during one recording, with standard errors.
struct RecordedMovement {
  double exposure_time_s = 0;
  double shift_px = 0, shift_error_px = 0;  // mean displacement during the exposure
  double blur_px2 = 0, blur_error_px2 = 0;  // variance of the displacement about it
};

// Variance of the displacement about its mean [px^2] during an exposure whose mean displacement is
// `mean_px`; a value beyond the largest that A and f allow counts as that.
double BlurByVibration(double amplitude_px, double frequency_hz, double exposure_time_s,
                       double mean_px);

// Logarithm of the likelihood of the movements [nats] about a common unknown place. The phase of
// each is integrated out. One recording in a thousand is an outlier of any displacement and blur.
// Standard errors are enlarged by what moments neglect of a profile's shape.
double VibrationLogLikelihood(std::span<const RecordedMovement> movements, double amplitude_px,
                              double frequency_hz);

struct VibrationFit {
  double amplitude_px = 0, amplitude_error_px = 0;
  double frequency_hz = 0, frequency_error_hz = 0;
};

// Most probable amplitude and frequency within 0.02 to 50 px and 1 Hz to 5 kHz, with a prior that
// is flat in their logarithms. Errors are half widths at which the profile likelihood falls by half
// a nat. At least one movement.
VibrationFit FitVibration(std::span<const RecordedMovement> movements);

// True if at least five single recordings show a blur of more than five standard errors: without
// such blurs a vibration cannot be distinguished from normal displacements.
bool IsSeenInSingleRecordings(std::span<const RecordedMovement> movements);

}  // namespace sightline
