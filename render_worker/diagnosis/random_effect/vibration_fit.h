// SPDX-License-Identifier: Apache-2.0
// What a vibration of the image, A sin(2 pi f t + phase) with a phase drawn for every recording,
// leaves in each of them: a displacement and a blur. Both follow from the phase, so neither is
// normal, and a blur is small where the displacement is largest.
#pragma once

#include <span>

namespace sightline {

// Of one recording, with standard errors.
struct RecordedMovement {
  double exposure_time_s = 0;
  double shift_px = 0, shift_error_px = 0;  // mean displacement during the exposure
  double blur_px2 = 0, blur_error_px2 = 0;  // variance of the displacement about it
};

// Variance of the displacement about its mean [px^2] during an exposure whose mean displacement is
// `mean_px`; beyond what A and f allow it counts as the farthest they do.
double BlurByVibration(double amplitude_px, double frequency_hz, double exposure_time_s,
                       double mean_px);

// Logarithm of the likelihood of the movements [nats] about a common place, which is not known; the
// phase of each is integrated out, and one in a thousand follows no law. Errors count as at least
// what the moments leave out of a profile's shape.
double VibrationLogLikelihood(std::span<const RecordedMovement> movements, double amplitude_px,
                              double frequency_hz);

struct VibrationFit {
  double amplitude_px = 0, amplitude_error_px = 0;
  double frequency_hz = 0, frequency_error_hz = 0;
};

// Most probable amplitude and frequency within 0.02 to 50 px and 1 Hz to 5 kHz, flat in their
// logarithms, with the standard deviations of what is probable near it. At least one movement.
VibrationFit FitVibration(std::span<const RecordedMovement> movements);

// True if blurs stand out in single recordings: only these tell the law from a normal scatter.
bool IsSeenInSingleRecordings(std::span<const RecordedMovement> movements);

}  // namespace sightline
