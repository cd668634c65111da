// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/uncertainty_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

void Add(v1::Verification* verification, double f_number, const char* channel, double e_u) {
  v1::RecordingVerification* recording = verification->add_recordings();
  recording->set_recording(verification->recordings_size() - 1);
  recording->set_f_number(f_number);
  v1::ChannelVerification* c = recording->add_channels();
  c->set_channel(channel);
  c->set_e_u(e_u);
}

v1::OpticsPlan PlanAt(double f_number) {
  v1::OpticsPlan plan;
  v1::OpticsPoint* best = plan.mutable_best();
  best->set_f_number(f_number);
  best->set_u_px(0.29);
  best->mutable_u_px_interval()->set_lower(0.27);
  best->mutable_u_px_interval()->set_upper(0.31);
  return plan;
}

// Thesis 6.4.3: u_real = u_sim / (1 - e_u); 0.29 px with an error of some 6 % become 0.31 px. The
// interval is that of one more recording: t of two degrees of freedom is 4.303.
TEST(UncertaintyCorrection, IsEquation68) {
  v1::Verification verification;
  for (const double e : {0.02, 0.06, 0.10}) Add(&verification, 2.8, "red", e);
  const auto correction = MakeCorrection(verification, "red", "verification.json");
  ASSERT_TRUE(correction.ok()) << correction.status();
  EXPECT_THAT(correction->remarks, IsEmpty());
  ASSERT_EQ(correction->errors.by_f_number_size(), 1);
  EXPECT_NEAR(correction->errors.by_f_number(0).mean_e_u(), 0.06, 1e-12);
  EXPECT_NEAR(correction->errors.by_f_number(0).standard_deviation(), 0.04, 1e-12);
  v1::OpticsPlan plan = PlanAt(2.8);
  ApplyCorrection(*correction, &plan);
  EXPECT_NEAR(plan.best().expected_real_u_px(), 0.29 / 0.94, 1e-12);
  EXPECT_NEAR(plan.best().expected_real_u_px(), 0.31, 0.005);
  const double half = 4.302653 * 0.04 * std::sqrt(1 + 1.0 / 3);
  EXPECT_NEAR(plan.best().expected_real_u_px_interval().lower(), 0.27 / (1 - (0.06 - half)), 1e-6);
  EXPECT_NEAR(plan.best().expected_real_u_px_interval().upper(), 0.31 / (1 - (0.06 + half)), 1e-6);
  EXPECT_THAT(plan.warnings(), IsEmpty());
}

// One recording says nothing of how recordings differ.
TEST(UncertaintyCorrection, OneRecordingGivesNoInterval) {
  v1::Verification verification;
  Add(&verification, 4, "mono", 0.1);
  Add(&verification, 8, "mono", 0.2);
  const auto correction = MakeCorrection(verification, "mono", "v.json");
  ASSERT_TRUE(correction.ok()) << correction.status();
  for (const double f_number : {4.0, 5.6, 8.0}) {
    v1::OpticsPlan plan = PlanAt(f_number);
    ApplyCorrection(*correction, &plan);
    EXPECT_GT(plan.best().expected_real_u_px(), 0.3);
    EXPECT_FALSE(plan.best().has_expected_real_u_px_interval());
    ASSERT_EQ(plan.warnings_size(), 1);
    EXPECT_THAT(plan.warnings(0), AllOf(HasSubstr("no interval"), HasSubstr("at least two")));
  }
}

TEST(UncertaintyCorrection, TooWideForAnIntervalIsNamed) {
  v1::Verification verification;
  for (const double e : {-0.3, 0.6}) Add(&verification, 4, "mono", e);
  v1::OpticsPlan plan = PlanAt(4);
  ApplyCorrection(*MakeCorrection(verification, "mono", "v.json"), &plan);
  EXPECT_NEAR(plan.best().expected_real_u_px(), 0.29 / 0.85, 1e-12);
  EXPECT_FALSE(plan.best().has_expected_real_u_px_interval());
  ASSERT_EQ(plan.warnings_size(), 1);
  EXPECT_THAT(plan.warnings(0), HasSubstr("differ too much"));
}

// Repeats the experiment: n recordings give an interval, one more recording lies in it or not.
TEST(UncertaintyCorrection, IntervalsHoldWhatTheyPromise) {
  constexpr int kExperiments = 4000;
  constexpr double kMean = 0.05, kDeviation = 0.03;
  struct Case {
    const char* what;
    std::vector<int> recordings;  // at f/4, f/5.6, ...; the next recording is at f/4
  };
  for (const Case& c : {Case{"two", {2}}, Case{"three", {3}}, Case{"ten", {10}},
                        Case{"one, pooled over four", {1, 4}},
                        Case{"one, pooled over eight in four groups", {1, 2, 2, 2, 2}}}) {
    std::mt19937 random(17);
    std::normal_distribution<double> e_u(kMean, kDeviation);
    int inside = 0;
    for (int i = 0; i < kExperiments; ++i) {
      v1::Verification verification;
      double f_number = 4;
      for (const int n : c.recordings) {
        for (int k = 0; k < n; ++k) Add(&verification, f_number, "mono", e_u(random));
        f_number *= std::sqrt(2.0);
      }
      const auto correction = MakeCorrection(verification, "mono", "v");
      ASSERT_TRUE(correction.ok());
      // Without uncertainty of the simulation, the interval is that of 1/(1 - e_u).
      v1::OpticsPlan plan = PlanAt(4);
      plan.mutable_best()->mutable_u_px_interval()->set_lower(0.29);
      plan.mutable_best()->mutable_u_px_interval()->set_upper(0.29);
      ApplyCorrection(*correction, &plan);
      const double real = 0.29 / (1 - e_u(random));
      const v1::OpticsPoint& best = plan.best();
      // No interval: e_u may be anything up to 1, which holds every value.
      inside += !best.has_expected_real_u_px_interval() ||
                (best.expected_real_u_px_interval().lower() <= real &&
                 real <= best.expected_real_u_px_interval().upper());
    }
    // 95 %, within four standard errors of so many experiments.
    EXPECT_NEAR(inside / double{kExperiments}, 0.95, 4 * std::sqrt(0.95 * 0.05 / kExperiments))
        << c.what;
  }
}

TEST(UncertaintyCorrection, IsLinearBetweenFNumbersAndEndsWithThem) {
  v1::Verification verification;
  Add(&verification, 4, "mono", 0.1);
  Add(&verification, 4, "mono", 0.2);
  Add(&verification, 16, "mono", -0.1);
  const auto correction = MakeCorrection(verification, "mono", "v");
  ASSERT_TRUE(correction.ok());
  // One recording alone gets the deviation of the others.
  EXPECT_GT(correction->errors.by_f_number(1).standard_deviation(), 0.05);
  v1::OpticsPlan between = PlanAt(8);
  ApplyCorrection(*correction, &between);
  EXPECT_NEAR(between.best().expected_real_u_px(), 0.29 / (1 - 0.025), 1e-12);
  v1::OpticsPlan outside = PlanAt(2);
  ApplyCorrection(*correction, &outside);
  EXPECT_EQ(outside.best().expected_real_u_px(), 0);
  ASSERT_EQ(outside.warnings_size(), 1);
  EXPECT_THAT(outside.warnings(0), HasSubstr("f/2"));
}

TEST(UncertaintyCorrection, TakesTheDetectedChannelAlone) {
  v1::Verification verification;
  Add(&verification, 4, "red", 0.1);
  Add(&verification, 4, "blue", 0.5);
  const auto red = MakeCorrection(verification, "red", "v");
  ASSERT_TRUE(red.ok());
  EXPECT_NEAR(red->errors.by_f_number(0).mean_e_u(), 0.1, 1e-12);
  ASSERT_EQ(red->remarks.size(), 1u);
  EXPECT_THAT(red->remarks[0], AllOf(HasSubstr("left out"), HasSubstr("recordings 1")));
  v1::OpticsPlan plan = PlanAt(4);
  ApplyCorrection(*red, &plan);
  EXPECT_THAT(plan.warnings(0), HasSubstr("left out"));
  // Another camera's channels are no substitute.
  for (const char* other : {"mono", "green"}) {
    const absl::Status status = MakeCorrection(verification, other, "v").status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()),
                AllOf(HasSubstr("channel blue, red"), HasSubstr(other)));
  }
  Add(&verification, 4, "mono", 0.1);
  EXPECT_THAT(std::string(MakeCorrection(verification, "mono", "v").status().message()),
              HasSubstr("monochrome and of a colour camera"));
}

TEST(UncertaintyCorrection, BadVerificationsAreNamed) {
  EXPECT_THAT(std::string(MakeCorrection({}, "red", "v.json").status().message()),
              HasSubstr("v.json: no recording has e_u"));
  v1::Verification verification;
  Add(&verification, 4, "red", 1.5);
  EXPECT_EQ(MakeCorrection(verification, "red", "v.json").status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
