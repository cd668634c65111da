// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/optics_planning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

absl::StatusOr<OpticsPlanning> Parse(const std::string& json, const Lens& lens = {}) {
  v1::OpticsPlanning message;
  SIGHTLINE_RETURN_IF_ERROR(ParseStrictJson(json, "test", &message));
  return ParseOpticsPlanning(message, lens, "inspection.json");
}

Lens LensFrom(double min_f_number, double max_f_number, double nearest_m) {
  Lens lens;
  lens.min_f_number = min_f_number;
  lens.max_f_number = max_f_number;
  lens.min_focus_distance_m = nearest_m;
  return lens;
}

TEST(OpticsPlanning, DefaultsAreTheThesis) {
  const auto planning = Parse("{}");
  ASSERT_TRUE(planning.ok()) << planning.status();
  EXPECT_THAT(planning->f_numbers, ElementsAre(1.4, 2, 2.8, 4, 5.6, 8, 11, 16, 22));
  EXPECT_EQ(planning->exposures, 300);
  EXPECT_EQ(planning->prior_uncertainty_px, 3);
  EXPECT_FALSE(planning->focus_distance_m.has_value());
}

TEST(OpticsPlanning, TheLensHasTheLastWord) {
  const auto planning = Parse("{}", LensFrom(2, 11, 0.1));
  ASSERT_TRUE(planning.ok());
  EXPECT_THAT(planning->f_numbers, ElementsAre(2, 2.8, 4, 5.6, 8, 11));
}

struct BadInput {
  const char* json;
  const char* field;
  const char* range;
};
class OpticsPlanningErrors : public ::testing::TestWithParam<BadInput> {};
TEST_P(OpticsPlanningErrors, NameFieldAndRange) {
  const auto planning = Parse(GetParam().json, LensFrom(1.4, 16, 0.1));
  ASSERT_FALSE(planning.ok());
  EXPECT_EQ(planning.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(planning.status().message()),
              AllOf(HasSubstr("inspection.json: "), HasSubstr(GetParam().field),
                    HasSubstr(GetParam().range)));
}
INSTANTIATE_TEST_SUITE_P(
    Cases, OpticsPlanningErrors,
    ::testing::Values(
        BadInput{R"({"f_numbers": [2, 22]})", "optics.f_numbers[1] is 22", "[1.4, 16], the lens's"},
        BadInput{R"({"exposure_time_s": {"min": 0.02, "max": 0.01}})", "optics.exposure_time_s",
                 "below max 0.01"},
        BadInput{R"({"exposure_time_s": {"min": 0, "max": 0.01}})",
                 "optics.exposure_time_s.min is 0", "(0, 100] s"},
        BadInput{R"({"focus_distance_m": {"fixed": 0.05}})",
                 "optics.focus_distance_m.fixed is 0.05",
                 "[0.1, 1000] m, what the lens focuses on"},
        BadInput{R"({"focus_distance_m": {"ranges": [{"min": 0.05, "max": 1}]}})",
                 "optics.focus_distance_m.ranges[0].min", "[0.1, 1000]"},
        BadInput{R"({"focus_distance_m": {}})", "optics.focus_distance_m", "none of"},
        BadInput{R"({"laser_power_w": {"fixed": -1}})", "optics.laser_power_w.fixed is -1",
                 "(0, 100] W"},
        BadInput{R"({"exposures": 1})", "optics.exposures is 1", "[2, 2000]"},
        BadInput{R"({"realisations": 1})", "optics.realisations is 1", "[2, 64]"},
        BadInput{R"({"prior_uncertainty_px": 0})", "optics.prior_uncertainty_px is 0", "(0, 1000]"},
        BadInput{R"({"frames_per_scan": 0})", "optics.frames_per_scan is 0", "[1, 64]"},
        BadInput{R"({"detection": {"ridge_sigma_px": 30}})", "optics.detection.ridge_sigma_px",
                 "(0.5, 20] px"},
        BadInput{R"({"detection": {"max_lines": 0}})", "optics.detection.max_lines is 0",
                 "[1, 64]"}));

}  // namespace
}  // namespace sightline
