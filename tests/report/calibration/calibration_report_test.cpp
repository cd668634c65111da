// SPDX-License-Identifier: Apache-2.0
#include "report/calibration/calibration_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/report/report_reading.h"

namespace sightline {
namespace {

CalibrationResult SampleCalibration() {
  CalibrationResult result;
  result.name = "line sensor";
  result.rig.shared = Eigen::VectorXd::LinSpaced(kPlaneZ + 1, 1000, 1000 + kPlaneZ);
  result.rig.covariance = 4 * Eigen::MatrixXd::Identity(kPlaneZ + 1, kPlaneZ + 1);
  result.rig.corner_sd_px = 0.123;
  result.planning.camera_distance_m = 0.4;
  result.ratio = {1.25, 0.9, 1.6};
  result.crossing_sd_px = 0.21;
  CalibrationFrameResult used;
  used.name = "frame 1";
  used.used = true;
  used.left_out = {{10, 20, 30}, {1e-5, -2e-5, 3e-5}, {1e-5, 1e-5, 2e-5}, 2.16e-5, 1.8e-5};
  used.corner_rms_px = 0.3;
  CalibrationFrameResult unused;
  unused.name = "frame 2";
  unused.because = "the board was not found";
  result.frames = {used, unused};
  result.warnings = {"3 % of the line are clipped"};
  return result;
}

TEST(CalibrationReport, SetsRealAgainstPredictedFrameByFrame) {
  const v1::Report report = CalibrationReport(SampleCalibration());
  EXPECT_EQ(ReportFault(report), "");
  EXPECT_EQ(report.heading(), "line sensor");
  EXPECT_EQ(report.figures(0).text(), "1.25");
  EXPECT_EQ(report.figures(0).number(), 1.25);
  EXPECT_EQ(report.figures(0).detail(), "0.90 to 1.60");
  EXPECT_EQ(report.figures(1).text(), "1 of 2");
  EXPECT_EQ(report.warnings(0), "3 % of the line are clipped");
  const v1::ReportTable frames = TablesOf(SectionOf(report, "frames"))[0];
  EXPECT_NEAR(CellOf(frames, "frame 1", "real rms").number(), 0.0216, 1e-12);
  EXPECT_NEAR(CellOf(frames, "frame 1", "real / predicted").number(), 1.2, 1e-12);
  EXPECT_EQ(CellOf(frames, "frame 1", "real / predicted").text(), "1.20");
  EXPECT_FALSE(CellOf(frames, "frame 2", "real rms").has_number());
  EXPECT_EQ(CellOf(frames, "frame 2", "remark").text(), "not used: the board was not found");
}

TEST(CalibrationReport, DrawsEachUsedFrameWithItsPredictedBand) {
  const auto charts = ChartsOf(SectionOf(CalibrationReport(SampleCalibration()), "line"));
  ASSERT_EQ(charts.size(), 1u);
  ASSERT_EQ(charts[0].series_size(), 2);
  const v1::ReportSeries &predicted = charts[0].series(0), &real = charts[0].series(1);
  EXPECT_NEAR(predicted.high(2), 2 * 0.02, 1e-12);
  EXPECT_NEAR(predicted.low(0), -2 * 0.01, 1e-12);
  EXPECT_NEAR(real.y(1), -0.02, 1e-12);
  EXPECT_EQ(charts[0].y().unit(), "mm");
}

TEST(CalibrationReport, DescribesTheScanner) {
  CalibrationResult result = SampleCalibration();
  const auto table_of = [](const CalibrationResult& of) {
    return TablesOf(SectionOf(CalibrationReport(of), "rig"))[0];
  };
  const v1::ReportCell error = CellOf(table_of(result), "focal length, x", "standard error");
  EXPECT_EQ(error.number(), 2);
  EXPECT_EQ(CellOf(table_of(result), "focal length, x", "unit").text(), "px");
  EXPECT_EQ(CellOf(table_of(result), "camera to laser plane along the axis", "value").number(),
            400);
  const int without = table_of(result).rows_size();
  result.reference = PlaneComparison{0.01, 0.3, 0.31};
  EXPECT_EQ(table_of(result).rows_size(), without + 4);
}

}  // namespace
}  // namespace sightline
