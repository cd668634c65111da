// SPDX-License-Identifier: Apache-2.0
// Look-ups in tables of exposure times, and tables that are refused.
#include "core/detectability/detectability.h"

#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/match.h"
#include "core/inspection/exposure_limit.h"
#include "core/json/strict_json.h"
#include "core/physics/angle.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A matt surface: the time is 1 ms over the cosine of the laser's incidence.
MaterialExposures Matt() {
  MaterialExposures material;
  material.camera_distances_m = {0.3, 0.6};
  for (int i = 0; i <= 16; ++i) {
    material.camera_incidence_rad.push_back(5 * i * kRadPerDeg);
    material.laser_incidence_rad.push_back(5 * i * kRadPerDeg);
  }
  for (int i = 0; i <= 6; ++i) material.azimuth_rad.push_back(30 * i * kRadPerDeg);
  material.laser_distance_m = 0.5;
  for (const double distance_m : material.camera_distances_m) {
    for (size_t camera = 0; camera < material.camera_incidence_rad.size(); ++camera) {
      for (const double laser : material.laser_incidence_rad) {
        for (size_t azimuth = 0; azimuth < material.azimuth_rad.size(); ++azimuth) {
          material.shortest_s.push_back(1e-3 * (distance_m / 0.3) / std::cos(laser));
          material.longest_s.push_back(material.shortest_s.back() * 100);
        }
      }
    }
  }
  return material;
}

TEST(ExposureTable, InterpolatesInTheLogarithmOfTheTimes) {
  const ExposureTable table(Matt());
  for (const double laser_deg : {0.0, 12.0, 33.0, 51.0, 68.0}) {
    const double cosine = std::cos(laser_deg * kRadPerDeg);
    const ExposureRange here = table.At(0.3, 0.5, std::cos(0.3), cosine, 0.7);
    // A chord of -ln cos over 5 degrees is off by at most a step squared over 8 cos^2.
    const double farthest = std::cos((laser_deg + 5) * kRadPerDeg), step = 5 * kRadPerDeg;
    const double error = step * step / (8 * farthest * farthest);
    EXPECT_NEAR(here.shortest_s, 1e-3 / cosine, error * here.shortest_s) << laser_deg;
    EXPECT_NEAR(here.longest_s, 0.1 / cosine, error * here.longest_s) << laser_deg;
  }
  // Half way between two distances the geometric mean.
  EXPECT_NEAR(table.At(0.45, 0.5, 1, 1, 1).shortest_s, 1e-3 * std::sqrt(2), 1e-9);
}

TEST(ExposureTable, IsConstantBeyondItsEnds) {
  const ExposureTable table(Matt());
  const double last = 1e-3 / std::cos(80 * kRadPerDeg);
  EXPECT_NEAR(table.At(0.3, 0.5, 1, std::cos(88 * kRadPerDeg), 0).shortest_s, last, 1e-9);
  EXPECT_NEAR(table.At(0.01, 0.5, 1, 1, 1).shortest_s, 1e-3, 1e-12);
  EXPECT_NEAR(table.At(9, 0.5, 1, 1, 1).shortest_s, 2e-3, 1e-12);
}

TEST(ExposureTable, TimesGrowWithTheDistanceOfTheLaser) {
  const ExposureTable table(Matt());
  const double near_s = table.At(0.4, 0.5, 0.9, 0.8, 0.6).shortest_s;
  EXPECT_NEAR(table.At(0.4, 1.5, 0.9, 0.8, 0.6).shortest_s, 3 * near_s, 1e-12);
}

// The azimuth is that of the mirror: 0 with both on one side, 180 degrees opposite.
TEST(ExposureTable, TakesTheAzimuthFromTheAngleBetweenTheDirections) {
  MaterialExposures material;
  material.camera_distances_m = {1};
  material.camera_incidence_rad = {30 * kRadPerDeg};
  material.laser_incidence_rad = {30 * kRadPerDeg};
  material.azimuth_rad = {0, 90 * kRadPerDeg, 180 * kRadPerDeg};
  material.laser_distance_m = 1;
  material.shortest_s = {1, 2, 4};
  material.longest_s = {10, 20, 40};
  const ExposureTable table(material);
  const double cosine = std::cos(30 * kRadPerDeg);
  EXPECT_NEAR(table.At(1, 1, cosine, cosine, 1).shortest_s, 1, 1e-6);
  EXPECT_NEAR(table.At(1, 1, cosine, cosine, cosine * cosine).shortest_s, 2, 1e-9);
  EXPECT_NEAR(table.At(1, 1, cosine, cosine, std::cos(60 * kRadPerDeg)).shortest_s, 4, 1e-6);
}

TEST(ExposureTable, IsInfiniteWhereTheNearestEntryIs) {
  MaterialExposures material = Matt();
  material.camera_distances_m = {1};
  material.camera_incidence_rad = {0};
  material.azimuth_rad = {0};
  material.laser_incidence_rad = {0, 1};
  material.shortest_s = {1e-3, kInfinity};
  material.longest_s = {1, kInfinity};
  const ExposureTable table(material);
  EXPECT_NEAR(table.At(1, 0.5, 1, 1, 1).shortest_s, 1e-3, 1e-12);
  EXPECT_NEAR(table.At(1, 0.5, 1, std::cos(0.4), 1).shortest_s, 1e-3, 1e-12);
  EXPECT_NEAR(table.At(1, 0.5, 1, std::cos(0.4), 1).longest_s, 1, 1e-9);
  EXPECT_TRUE(std::isinf(table.At(1, 0.5, 1, std::cos(0.6), 1).shortest_s));
  EXPECT_TRUE(std::isinf(table.At(1, 0.5, 1, std::cos(1.2), 1).shortest_s));
}

// One entry, written as a file has it.
constexpr char kGood[] = R"({"min_exposure_time_s": 1e-4, "max_exposure_time_s": 0.01,
  "table": {"materials": [{"part_material": "paint", "camera_distances_m": [0.4],
    "camera_incidence_deg": [0, 60], "laser_incidence_deg": [0], "azimuth_deg": [0],
    "laser_distance_m": 0.5, "shortest_exposure_time_s": [1e-3, "Infinity"],
    "longest_exposure_time_s": [0.5, "Infinity"]}]}})";

absl::StatusOr<Detectability> ReadDetectability(std::string json, const std::string& from = "",
                                                const std::string& to = "") {
  if (!from.empty()) {
    const size_t at = json.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    json.replace(at, from.size(), to);
  }
  v1::Detectability message;
  SIGHTLINE_RETURN_IF_ERROR(ParseStrictJson(json, "test", &message));
  return ParseDetectability(message, "file");
}

TEST(Detectability, ReadsATableWithInfiniteTimes) {
  const auto read = ReadDetectability(kGood);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->materials.size(), 1u);
  EXPECT_EQ(read->materials[0].part_material, "paint");
  EXPECT_TRUE(std::isinf(read->materials[0].shortest_s[1]));
  EXPECT_DOUBLE_EQ(*read->max_exposure_time_s, 0.01);
}

// Other fields have no infinity, and these have no NaN.
TEST(Detectability, HasInfinityInTimesAlone) {
  for (const auto& [from, to] :
       {std::pair("[1e-3, \"Infinity\"]", "[\"NaN\", 1]"),
        std::pair("\"laser_distance_m\": 0.5", "\"laser_distance_m\": \"Infinity\"")}) {
    EXPECT_EQ(ReadDetectability(kGood, from, to).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
}

TEST(Detectability, RefusesBadTablesByName) {
  const struct {
    const char *from, *to, *message;
  } cases[] = {
      {"[0, 60]", "[60, 0]", "camera_incidence_deg[1] is 0, must be above 60"},
      {"[0, 60]", "[0, 95]", "camera_incidence_deg[1] is 95, must be in [0, 90] deg"},
      {"[0, 60]", "[0]", "shortest_exposure_time_s has 2 entries, must have 1"},
      {"\"azimuth_deg\": [0]", "\"azimuth_deg\": []", "azimuth_deg is missing"},
      {"[1e-3, \"Infinity\"]", "[0, 1]", "shortest_exposure_time_s[0] is 0"},
      {"[0.5, \"Infinity\"]", "[1e-4, \"Infinity\"]", "must be at least the shortest time, 0.001"},
      {"\"laser_distance_m\": 0.5", "\"laser_distance_m\": 0", "laser_distance_m is 0"},
      {"1e-4,", "0.1,", "min_exposure_time_s is 0.1 s, must be at most"},
      {"{\"min", "{\"min_detected_fraction\": 1.5, \"min", "min_detected_fraction is 1.5"},
  };
  for (const auto& bad : cases) {
    const auto read = ReadDetectability(kGood, bad.from, bad.to);
    ASSERT_FALSE(read.ok()) << bad.message;
    EXPECT_TRUE(absl::StrContains(read.status().message(), bad.message)) << read.status();
    EXPECT_TRUE(absl::StrContains(read.status().message(), "file: detectability."))
        << read.status();
  }
}

TEST(PermittedExposures, AreThoseOfTheCameraAndTheStage) {
  Inspection inspection;
  inspection.domain = ThesisDomain();
  inspection.min_exposure_time_s = 2e-5;
  inspection.max_exposure_time_s = 0.5;
  auto permitted = PermittedExposuresOf(inspection, "file");
  ASSERT_TRUE(permitted.ok());
  EXPECT_DOUBLE_EQ(permitted->shortest_s, 2e-5);
  EXPECT_DOUBLE_EQ(permitted->longest_s, 0.5);

  inspection.optics.emplace();
  inspection.stated_costs.frame_rate_hz = 50;
  inspection.optics->max_motion_blur_px = 1000;
  permitted = PermittedExposuresOf(inspection, "file");
  ASSERT_TRUE(permitted.ok());
  EXPECT_DOUBLE_EQ(permitted->longest_s, 0.02);

  // Half a pixel at the nearest camera distance of the domain.
  inspection.optics->max_motion_blur_px = 0.5;
  inspection.stated_costs.stage_speed_m_per_s = 0.05;
  inspection.domain.parameters[kCameraDistance] = {.ranges = {{0.4, 0.8}}, .values = {}};
  permitted = PermittedExposuresOf(inspection, "file");
  ASSERT_TRUE(permitted.ok());
  EXPECT_NEAR(permitted->longest_s, 0.5 / (inspection.rig.camera.FocalLengthPx() / 0.4 * 0.05),
              1e-9);

  inspection.detectability.emplace().min_exposure_time_s = 10;
  EXPECT_TRUE(absl::StrContains(PermittedExposuresOf(inspection, "file").status().message(),
                                "shortest permitted exposure, 10 s"));
}

TEST(PermittedExposures, AreNotLongerOrShorterThanThoseOfTheCamera) {
  Inspection inspection;
  inspection.domain = ThesisDomain();
  inspection.min_exposure_time_s = 2e-5;
  inspection.max_exposure_time_s = 0.5;
  inspection.detectability.emplace().max_exposure_time_s = 0.6;
  EXPECT_TRUE(absl::StrContains(PermittedExposuresOf(inspection, "file").status().message(),
                                "max_exposure_time_s is 0.6 s, longer than the camera's"));
  inspection.detectability->max_exposure_time_s = 0.4;
  inspection.detectability->min_exposure_time_s = 1e-5;
  EXPECT_TRUE(absl::StrContains(PermittedExposuresOf(inspection, "file").status().message(),
                                "shorter than the camera's"));
}

}  // namespace
}  // namespace sightline
