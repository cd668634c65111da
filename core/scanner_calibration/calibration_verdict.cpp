// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/calibration_verdict.h"

#include <cmath>

#include "absl/strings/str_format.h"

namespace sightline {

CalibrationVerdict VerdictOf(const ScatterRatio& ratio, int frames) {
  if (frames < kFewestFramesForVerdict || !(ratio.value > 0) || !std::isfinite(ratio.value) ||
      !std::isfinite(ratio.high)) {
    return CalibrationVerdict::kNotDecided;
  }
  if (ratio.low > kLargestPermittedRatio) return CalibrationVerdict::kRealErrorsLarger;
  if (ratio.high < kLeastPermittedRatio) return CalibrationVerdict::kRealErrorsSmaller;
  const bool permitted =
      ratio.value >= kLeastPermittedRatio && ratio.value <= kLargestPermittedRatio;
  const bool narrow =
      ratio.low >= 0.5 * kLeastPermittedRatio && ratio.high <= 2 * kLargestPermittedRatio;
  return permitted && narrow ? CalibrationVerdict::kAgrees : CalibrationVerdict::kNotDecided;
}

const char* NameOf(CalibrationVerdict verdict) {
  switch (verdict) {
    case CalibrationVerdict::kAgrees:
      return "AGREES";
    case CalibrationVerdict::kRealErrorsLarger:
      return "REAL_ERRORS_LARGER";
    case CalibrationVerdict::kRealErrorsSmaller:
      return "REAL_ERRORS_SMALLER";
    case CalibrationVerdict::kNotDecided:
      break;
  }
  return "NOT_DECIDED";
}

std::string VerdictText(const ScatterRatio& ratio, int frames) {
  switch (VerdictOf(ratio, frames)) {
    case CalibrationVerdict::kAgrees:
      return absl::StrFormat(
          "The geometry agrees: real errors are %.2f times the predicted ones, within the "
          "permitted "
          "%.1f to %.1f. Plans can rely on the predicted uncertainty.",
          ratio.value, kLeastPermittedRatio, kLargestPermittedRatio);
    case CalibrationVerdict::kRealErrorsLarger:
      return absl::StrFormat(
          "The geometry does not agree: real errors are %.2f times the predicted ones, at least "
          "%.2f times. Plans would promise too much. Look at the frames with remarks and at the "
          "plots along the line before this description is used.",
          ratio.value, ratio.low);
    case CalibrationVerdict::kRealErrorsSmaller:
      return absl::StrFormat(
          "The geometry does not agree: real errors are only %.2f times the predicted ones, at "
          "most "
          "%.2f times. Plans would ask for more scans than needed. Often one bad frame is still "
          "used.",
          ratio.value, ratio.high);
    case CalibrationVerdict::kNotDecided:
      break;
  }
  if (frames < kFewestFramesForVerdict) {
    return absl::StrFormat(
        "%d frames do not decide whether the geometry agrees, %d are needed and 12 or more are "
        "recommended: real errors are %.2f times the predicted ones.",
        frames, kFewestFramesForVerdict, ratio.value);
  }
  return absl::StrFormat(
      "These frames do not decide whether the geometry agrees: real errors are %.2f times the "
      "predicted ones, with an interval from %.2f to %.2f. Record more frames, or frames in which "
      "the target is tilted more.",
      ratio.value, ratio.low, ratio.high);
}

std::string FarOffRemark(const LeftOutFrame& frame) {
  if (!(frame.rms_m > kFarOffRatio * frame.predicted_rms_m)) return "";
  return absl::StrFormat(
      "%.1f times as far off as predicted: look at its plot, and record it again if its corners "
      "or its line are disturbed",
      frame.rms_m / frame.predicted_rms_m);
}

}  // namespace sightline
