// SPDX-License-Identifier: Apache-2.0
// Dependence of an amplitude on the set-up of the recordings, by regression.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render_worker/frame/frame_setup.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// An amplitude in one recording (of a residual, or of a term fitted to it alone), and the set-up of
// the recording. Unknown quantities are NaN and are not tried.
struct SetupAmplitude {
  double amplitude = 0;
  double standard_error = 1;  // > 0
  double exposure_time_s = 0;
  double f_number = 0;
  double camera_distance_m = 0;
  double focus_distance_m = 0;
  double defocus_px = 0;  // diameter of the blur on the sensor, see SetupOf
  double laser_distance_m = 0;
  double timestamp_s = 0;
  double signal_level = 0;  // e.g. mean of the line over full scale
  double burst_frame_index = 0;
  double field_position_m = 0;  // distance from the principal point, on the sensor
  double row = 0;               // of the line, from the principal point [px]
};

// Set-up of a frame, without amplitude. The signal level is NaN; the field position is that of the
// region's middle. Defocus: D |b/b' - 1| / pitch, the geometric blur of a point of the plate.
SetupAmplitude SetupOf(const FrameSetup& frame);

struct SetupLawSettings {
  // Probability of a false dependence if the amplitudes are independent of the set-up.
  double significance = 0.01;
  uint64_t seed = 1;  // of the permutations
};

// Searches among a constant and B + A g with B = 0 or free. g is a product of up to three powers of
// quantities over their typical values, with exponents usual in physics (halves, 1, 2, 3, 4), or an
// exponential or a step in time. The shortest description wins: twice the negative log-likelihood,
// plus ln(n) per fitted number, 2 ln(forms) for the choice among similar forms, and 2
// ln(1/significance) per further quantity (Rissanen, Automatica 14 (1978) 465; Schwarz, Ann.
// Statist. 6 (1978) 461). The likelihood is Student's with four degrees of freedom, so that
// outliers count little, and a common scale not below the standard errors (Lange, Little and
// Taylor, J. Am. Stat. Assoc. 84 (1989) 881), so that underestimated standard errors do no harm.
// The gain over the constant must exceed that of permutations of the standardised residuals
// (Freedman and Lane, J. Bus. Econ. Stat. 1 (1983) 292).
//
// Returns one entry per quantity of the dependence, the most explanatory first, with its freely
// fitted exponent (exponential and step: 0) and the fraction of the sum of squares about the
// constant that the fit loses without it. Alternatives in other quantities that are nearly as good
// follow ("or ..."). One entry with the quantity "none" if there is no dependence or there are
// fewer than 6 amplitudes.
std::vector<v1::SetupLaw> FindSetupLaws(std::span<const SetupAmplitude> amplitudes,
                                        const SetupLawSettings& settings);

}  // namespace sightline
