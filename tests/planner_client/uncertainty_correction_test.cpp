// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/uncertainty_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace sightline {
namespace {

using ::testing::HasSubstr;

void Add(v1::Verification* verification, double f_number, const char* channel, double e_u) {
  v1::RecordingVerification* recording = verification->add_recordings();
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

// Thesis 6.4.3: u_real = u_sim / (1 - e_u); 0.29 px with an error of some 6 % become 0.31 px.
TEST(UncertaintyCorrection, IsEquation68) {
  v1::Verification verification;
  for (const double e : {0.02, 0.06, 0.10}) Add(&verification, 2.8, "red", e);
  const auto correction = MakeCorrection(verification, "red", "verification.json");
  ASSERT_TRUE(correction.ok()) << correction.status();
  ASSERT_EQ(correction->by_f_number_size(), 1);
  EXPECT_NEAR(correction->by_f_number(0).mean_e_u(), 0.06, 1e-12);
  EXPECT_NEAR(correction->by_f_number(0).standard_deviation(), 0.04, 1e-12);
  v1::OpticsPlan plan = PlanAt(2.8);
  ApplyCorrection(*correction, &plan);
  EXPECT_NEAR(plan.best().expected_real_u_px(), 0.29 / 0.94, 1e-12);
  EXPECT_NEAR(plan.best().expected_real_u_px(), 0.31, 0.005);
  EXPECT_NEAR(plan.best().expected_real_u_px_interval().lower(), 0.27 / (1 + 0.02), 1e-12);
  EXPECT_NEAR(plan.best().expected_real_u_px_interval().upper(), 0.31 / (1 - 0.14), 1e-12);
}

TEST(UncertaintyCorrection, IsLinearBetweenFNumbersAndEndsWithThem) {
  v1::Verification verification;
  Add(&verification, 4, "mono", 0.1);
  Add(&verification, 4, "mono", 0.2);
  Add(&verification, 16, "mono", -0.1);
  const auto correction = MakeCorrection(verification, "mono", "v");
  ASSERT_TRUE(correction.ok());
  // One recording alone gets the deviation of the others.
  EXPECT_GT(correction->by_f_number(1).standard_deviation(), 0.05);
  v1::OpticsPlan between = PlanAt(8);
  ApplyCorrection(*correction, &between);
  EXPECT_NEAR(between.best().expected_real_u_px(), 0.29 / (1 - 0.025), 1e-12);
  v1::OpticsPlan outside = PlanAt(2);
  ApplyCorrection(*correction, &outside);
  EXPECT_EQ(outside.best().expected_real_u_px(), 0);
  ASSERT_EQ(outside.warnings_size(), 1);
  EXPECT_THAT(outside.warnings(0), HasSubstr("f/2"));
}

TEST(UncertaintyCorrection, TakesTheDetectedChannel) {
  v1::Verification verification;
  Add(&verification, 4, "red", 0.1);
  Add(&verification, 4, "blue", 0.5);
  EXPECT_NEAR(MakeCorrection(verification, "red", "v")->by_f_number(0).mean_e_u(), 0.1, 1e-12);
  // A channel that was not verified: all of them.
  EXPECT_NEAR(MakeCorrection(verification, "mono", "v")->by_f_number(0).mean_e_u(), 0.3, 1e-12);
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
