// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/calibration_verdict.h"

#include <gtest/gtest.h>

#include <limits>

namespace sightline {
namespace {

TEST(CalibrationVerdictTest, AgreesOnlyWhereTheIntervalIsNarrowEnough) {
  EXPECT_EQ(VerdictOf({1.0, 0.8, 1.2}, 12), CalibrationVerdict::kAgrees);
  EXPECT_EQ(VerdictOf({1.0, 0.1, 1.2}, 12), CalibrationVerdict::kNotDecided);
  EXPECT_EQ(VerdictOf({1.0, 0.8, 4.0}, 12), CalibrationVerdict::kNotDecided);
}

TEST(CalibrationVerdictTest, DisagreesOnlyWhereTheWholeIntervalLiesBeyondAPermittedRatio) {
  EXPECT_EQ(VerdictOf({2.0, 1.5, 2.5}, 12), CalibrationVerdict::kRealErrorsLarger);
  EXPECT_EQ(VerdictOf({2.0, 1.3, 2.5}, 12), CalibrationVerdict::kNotDecided);
  EXPECT_EQ(VerdictOf({0.5, 0.4, 0.6}, 12), CalibrationVerdict::kRealErrorsSmaller);
  EXPECT_EQ(VerdictOf({0.5, 0.4, 0.8}, 12), CalibrationVerdict::kNotDecided);
}

TEST(CalibrationVerdictTest, DoesNotDecideWithoutANumber) {
  EXPECT_EQ(VerdictOf({0, 0, 0}, 12), CalibrationVerdict::kNotDecided);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(VerdictOf({nan, nan, nan}, 12), CalibrationVerdict::kNotDecided);
}

TEST(CalibrationVerdictTest, DoesNotDecideByFewFrames) {
  for (const ScatterRatio& ratio :
       {ScatterRatio{1.0, 0.8, 1.2}, ScatterRatio{0.1, 0.1, 0.3}, ScatterRatio{3.0, 2.5, 3.5}}) {
    EXPECT_EQ(VerdictOf(ratio, 7), CalibrationVerdict::kNotDecided);
    EXPECT_NE(VerdictOf(ratio, 8), CalibrationVerdict::kNotDecided);
  }
  EXPECT_NE(VerdictText({1.0, 0.8, 1.2}, 4).find("4 frames do not decide"), std::string::npos);
}

TEST(CalibrationVerdictTest, RemarksFramesThatAreFartherOffThanPredicted) {
  LeftOutFrame frame;
  frame.predicted_rms_m = 1e-4;
  frame.rms_m = 1.9e-4;
  EXPECT_EQ(FarOffRemark(frame), "");
  frame.rms_m = 2.6e-4;
  EXPECT_NE(FarOffRemark(frame).find("2.6 times"), std::string::npos);
}

}  // namespace
}  // namespace sightline
