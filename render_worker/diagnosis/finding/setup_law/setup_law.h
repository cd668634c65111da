// SPDX-License-Identifier: Apache-2.0
// Dependence of an amplitude on the set-up of the recordings, by regression.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render_worker/frame/frame_setup.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// An amplitude found in one recording (of a residual, or of a term fitted to it alone), and what
// the recording was taken with. Quantities that are not known are NaN: no law in them is tried.
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

// Set-up of a frame, without amplitude. Signal level: NaN. Field position: that of the region's
// middle. Defocus: D |b/b' - 1| / pitch, the geometric blur of a point of the plate.
SetupAmplitude SetupOf(const FrameSetup& frame);

struct SetupLawSettings {
  // Probability that amplitudes that do not depend on the set-up are said to.
  double significance = 0.01;
  uint64_t seed = 1;  // of the permutations
};

// Search over a constant and B + A g, B = 0 or free: g a product of up to three powers of
// quantities over their typical values, with the exponents physics has (halves, 1, 2, 3, 4), or an
// exponential or a step in time. The least description wins: twice the negative log-likelihood,
// ln(n) for every number fitted, 2 ln(forms) for the choice among forms alike, 2 ln(1/significance)
// for every further quantity (Rissanen, Automatica 14 (1978) 465; Schwarz, Ann. Statist. 6 (1978)
// 461). The likelihood is Student's, of four degrees of freedom, so that outliers count little, and
// of a common scale of at least that of the standard errors (Lange, Little and Taylor, J. Am. Stat.
// Assoc. 84 (1989) 881): standard errors too small by a factor do no harm. The gain over the
// constant must be larger than in permutations of the standardised residuals (Freedman and Lane, J.
// Bus. Econ. Stat. 1 (1983) 292).
//
// One entry per quantity of the law, the one that explains most first, with its exponent fitted
// freely (exponential and step: 0) and the part of the sum of squares about the constant that the
// law loses without it; then laws in other quantities that describe the amplitudes almost as well
// ("or ..."). Without dependence: one entry, quantity "none". Fewer than 6 amplitudes: likewise.
std::vector<v1::SetupLaw> FindSetupLaws(std::span<const SetupAmplitude> amplitudes,
                                        const SetupLawSettings& settings);

}  // namespace sightline
