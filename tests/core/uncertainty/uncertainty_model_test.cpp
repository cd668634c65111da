// SPDX-License-Identifier: Apache-2.0
#include "core/uncertainty/uncertainty_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/triangulation/calibration_derivatives.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

absl::StatusOr<UncertaintyModel> Parse(const std::string& json) {
  v1::Uncertainty message;
  SIGHTLINE_RETURN_IF_ERROR(ParseStrictJson(json, "file", &message));
  return ParseUncertainty(message, "file");
}

absl::StatusOr<Inspection> ParseWhole(const std::string& fields) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(
      ParseStrictJson(R"({"part": {"file": "a.glb"}, )" + fields + "}", "file", &message));
  return ParseInspection(message, "file", "");
}

TEST(UncertaintyModel, DefaultsAreThoseOfTheThesis) {
  const auto model = Parse("{}");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->detection.At(0.3, 0.5), 0.2);
  EXPECT_EQ(model->prior_standard_deviation_m, 0.01);
  EXPECT_EQ(model->resolution_m, 0.003);
  EXPECT_FALSE(model->HasCalibrationErrors());
}

TEST(UncertaintyModel, TablesAreInterpolatedBetweenTheirEnds) {
  const auto model = Parse(R"({"line_detection": {"exposure_time_s": 0.003, "table": {
      "distances_m": [0.1, 0.3], "incidence_angles_deg": [0, 60],
      "exposure_times_s": [0.002, 0.004],
      "standard_deviations_px": [0.1, 0.2, 0.3, 0.4, 0.3, 0.4, 0.5, 0.6]}}})");
  ASSERT_TRUE(model.ok()) << model.status();
  const double degree = std::numbers::pi / 180;
  EXPECT_NEAR(model->detection.At(0.1, 0), 0.2, 1e-12);  // halfway between the exposures
  EXPECT_NEAR(model->detection.At(0.2, 30 * degree), 0.35, 1e-12);
  EXPECT_NEAR(model->detection.At(0.01, -1), 0.2, 1e-12);
  EXPECT_NEAR(model->detection.At(9, 89 * degree), 0.5, 1e-12);
  // The normal form says the same.
  const auto again = ParseUncertainty(UncertaintyToProto(*model), "again");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_NEAR(again->detection.At(0.2, 30 * degree), 0.35, 1e-12);
}

TEST(UncertaintyModel, CalibrationByDeviationsOrByCovariance) {
  const auto model = Parse(R"({"calibration": {"camera_position_m": 0.0005,
      "laser_rotation_deg": 0.01, "focal_length_px": 2}})");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_DOUBLE_EQ(model->calibration(kCameraY, kCameraY), 0.25e-6);
  EXPECT_DOUBLE_EQ(model->calibration(kFocalLengthError, kFocalLengthError), 4);
  // The thesis's cone of this half angle as two tilts.
  const double angle = 0.01 * std::numbers::pi / 180;
  EXPECT_NEAR(model->calibration(kSheetTiltX, kSheetTiltX), 0.5 * angle * angle, 1e-15);
  EXPECT_EQ(model->calibration(kImageX, kImageX), 0);
  const auto again = ParseUncertainty(UncertaintyToProto(*model), "again");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(again->calibration.isApprox(model->calibration, 1e-15));
}

TEST(UncertaintyModel, RefusesWhatCannotBe) {
  const auto expect = [](const std::string& json, const std::string& text) {
    const auto model = Parse(json);
    EXPECT_EQ(model.status().code(), absl::StatusCode::kInvalidArgument) << json;
    EXPECT_THAT(std::string(model.status().message()), HasSubstr(text)) << json;
  };
  expect(R"({"line_detection": {"standard_deviation_px": 0}})",
         "file: uncertainty.line_detection.standard_deviation_px is 0");
  expect(R"({"line_detection": {"standard_deviation_px": -0.2}})", "is -0.2");
  expect(R"({"line_detection": {"exposure_time_s": 0.1}})", "needs a table");
  expect(R"({"line_detection": {"table": {"distances_m": [0.2, 0.1],
      "incidence_angles_deg": [0], "standard_deviations_px": [1, 1]}}})",
         "distances_m[1] is 0.1, must be above 0.2");
  expect(R"({"line_detection": {"table": {"distances_m": [0.1],
      "incidence_angles_deg": [0], "standard_deviations_px": [1, 1]}}})",
         "has 2 entries, must have 1");
  expect(R"({"calibration": {"camera_rotation_deg": -1}})", "camera_rotation_deg is -1");
  expect(R"({"calibration": {"covariance": [1, 2]}})", "has 2 entries, must have 144");
  expect(R"({"prior_standard_deviation_m": 0})", "prior_standard_deviation_m is 0");
  expect(R"({"resolution_m": 0})", "resolution_m is 0");
  v1::Uncertainty message;
  for (int i = 0; i < 144; ++i) {
    message.mutable_calibration()->add_covariance(i % 13 == 0 ? 1e-6 : 0);
  }
  EXPECT_TRUE(ParseUncertainty(message, "file").ok());
  message.mutable_calibration()->set_covariance(1, 2e-6);  // beyond the variances, and one-sided
  EXPECT_EQ(ParseUncertainty(message, "file").status().code(), absl::StatusCode::kInvalidArgument);
  message.mutable_calibration()->set_covariance(12, 2e-6);
  EXPECT_EQ(ParseUncertainty(message, "file").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(UncertaintyGoal, NeedsAModelAndTolerances) {
  EXPECT_THAT(std::string(ParseWhole(R"("goal": {"admissible": 0.8})").status().message()),
              HasSubstr("uncertainty is missing: goal.admissible needs it"));
  EXPECT_THAT(
      std::string(
          ParseWhole(R"("uncertainty": {}, "goal": {"admissible": 0.8})").status().message()),
      HasSubstr("tolerances is missing"));
  EXPECT_THAT(std::string(ParseWhole(R"("uncertainty": {}, "tolerances": {"zone_width_m": 0.0002},
      "goal": {"admissible": 0.8, "coverage": 0.9})")
                              .status()
                              .message()),
              HasSubstr("goal.coverage cannot be given together with goal.admissible"));
  const auto inspection = ParseWhole(R"("uncertainty": {"resolution_m": 0.0015},
      "tolerances": {"zone_width_m": 0.0002}, "goal": {"admissible": 0.8})");
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(*inspection->goal.admissible, 0.8);
  EXPECT_EQ(inspection->goal.coverage, 0);
  // A sixth of the resolution, unless it is stated.
  EXPECT_DOUBLE_EQ(inspection->rig.scan_step_m, 0.00025);
  const auto stated = ParseWhole(R"("uncertainty": {}, "rig": {"scan_step_m": 0.001})");
  ASSERT_TRUE(stated.ok()) << stated.status();
  EXPECT_EQ(stated->rig.scan_step_m, 0.001);
}

TEST(UncertaintyGoal, CalibrationAndRegistrationHaveDefaults) {
  const auto whole = [](const std::string& uncertainty, const std::string& more = "") {
    const auto inspection = ParseWhole(R"("uncertainty": )" + uncertainty + more);
    EXPECT_TRUE(inspection.ok()) << inspection.status();
    return inspection.ok() ? *inspection->uncertainty : UncertaintyModel();
  };
  const UncertaintyModel assumed = whole("{}");
  EXPECT_TRUE(assumed.calibration_assumed);
  EXPECT_TRUE(assumed.calibration.isApprox(CalibrationOnSite()));
  EXPECT_EQ(assumed.registration, RegistrationMethod::kBestFit);
  const UncertaintyModel none = whole(R"({"calibration": {}, "registration": "NONE"})");
  EXPECT_FALSE(none.calibration_assumed);
  EXPECT_FALSE(none.HasCalibrationErrors());
  EXPECT_EQ(none.registration, RegistrationMethod::kNone);
  const UncertaintyModel older = whole("{}", R"(, "defaults": "0.1")");
  EXPECT_FALSE(older.HasCalibrationErrors());
  EXPECT_EQ(older.registration, RegistrationMethod::kNone);
  const UncertaintyModel known = whole(
      R"({"registration": "KNOWN_POSES", "registration_position_m": 1e-5,
          "registration_angle_deg": 0.01})");
  EXPECT_EQ(known.registration_position_m, 1e-5);
  EXPECT_NEAR(known.registration_angle_rad, 0.01 * std::numbers::pi / 180, 1e-15);
  EXPECT_THAT(
      std::string(ParseWhole(R"("uncertainty": {"registration_angle_deg": 1})").status().message()),
      HasSubstr("uncertainty.registration_angle_deg needs uncertainty.registration KNOWN_POSES"));
}

// The numbers that the documentation states.
TEST(UncertaintyModel, TheAssumedCalibrationIsThatOfAPublishedSensor) {
  const double d_m = 0.4, angle = std::numbers::pi / 6;
  TriangulationSetup setup;
  setup.camera = {{0, 0, d_m}, {1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  const Eigen::Vector3d x(1, 0, 0), z(0, -std::sin(angle), -std::cos(angle));
  setup.laser = {-d_m * z, x, z.cross(x), z};
  const auto depth_m = [&](double focal_length_px) {
    setup.focal_length_px = focal_length_px;
    const CalibrationRow row =
        CalibrationDerivatives(setup, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
    const CalibrationCovariance covariance =
        CalibrationOnSite().bottomRightCorner<kCalibrationVariables, kCalibrationVariables>();
    return std::sqrt((row * covariance).dot(row));
  };
  EXPECT_NEAR(depth_m(2400), 0.042e-3, 0.5e-6);
  EXPECT_NEAR(depth_m(618), 0.116e-3, 0.5e-6);
}

TEST(UncertaintyGoal, TolerancesAreChecked) {
  const auto expect = [](const std::string& tolerances, const std::string& text) {
    const auto inspection = ParseWhole(R"("uncertainty": {}, "tolerances": )" + tolerances);
    EXPECT_EQ(inspection.status().code(), absl::StatusCode::kInvalidArgument) << tolerances;
    EXPECT_THAT(std::string(inspection.status().message()), HasSubstr(text)) << tolerances;
  };
  expect("{}", "tolerances has none of zone_width_m, file, regions");
  expect(R"({"zone_width_m": 0})", "tolerances.zone_width_m is 0");
  expect(R"({"zone_width_m": 0.1, "guard_factor": 0})", "guard_factor is 0");
  expect(R"({"zone_width_m": 0.1, "least_acceptance_zone": 1})", "least_acceptance_zone is 1");
  expect(R"({"regions": [{"zone_width_m": 0.1}]})", "regions[0].name is missing");
  expect(R"({"regions": [{"name": "a", "zone_width_m": 0.1}]})",
         "has none of min_m with max_m, materials, faces");
  expect(R"({"regions": [{"name": "a", "zone_width_m": 0.1, "faces": [1]}]})",
         "faces needs tolerances.file");
  expect(R"({"regions": [{"name": "a", "zone_width_m": 0.1,
      "min_m": {"x": 1}, "max_m": {"x": 1, "y": 1, "z": 1}}]})",
         "max_m must be above min_m");
}

}  // namespace
}  // namespace sightline
