// SPDX-License-Identifier: Apache-2.0
// Verdict on the predicted uncertainty of a calibrated scanner, on which plans rely: the ratio of
// real to predicted deviations in left-out frames, with its 95 % interval.
#pragma once

#include <string>

#include "core/scanner_calibration/left_out_frames.h"

namespace sightline {

enum class CalibrationVerdict {
  kAgrees,             // plans may rely on the predicted uncertainty
  kRealErrorsLarger,   // real errors are larger than predicted
  kRealErrorsSmaller,  // real errors are smaller than predicted
  kNotDecided,         // more frames are needed
};

// Permitted ratios: a standard uncertainty from some ten frames is itself uncertain by a quarter
// (JCGM 100:2008, E.4.3, table E.1: 24 % for 10 observations).
inline constexpr double kLeastPermittedRatio = 0.7, kLargestPermittedRatio = 1.4;

// Fewer frames than this decide nothing: the interval over frames is then too narrow, since it is
// found by drawing from the few that there are.
inline constexpr int kFewestFramesForVerdict = 8;

// A frame whose real scatter is larger than this many times the predicted one gets a remark.
inline constexpr double kFarOffRatio = 2;

// `frames`: used frames. kAgrees: kLeastPermittedRatio <= value <= kLargestPermittedRatio, and the
// interval stays within half of the least and twice the largest permitted ratio. kRealErrorsLarger
// or kRealErrorsSmaller: the whole interval lies beyond a permitted ratio. Fewer frames than
// kFewestFramesForVerdict, a ratio of 0, or one that is not finite, decide nothing.
CalibrationVerdict VerdictOf(const ScatterRatio& ratio, int frames);

// "AGREES", "REAL_ERRORS_LARGER", "REAL_ERRORS_SMALLER", "NOT_DECIDED".
const char* NameOf(CalibrationVerdict verdict);

// A sentence for people: the verdict, its consequence for plans, and what to do.
std::string VerdictText(const ScatterRatio& ratio, int frames);

// The remark of a used frame; empty if its scatter is within kFarOffRatio of the predicted one.
std::string FarOffRemark(const LeftOutFrame& frame);

}  // namespace sightline
