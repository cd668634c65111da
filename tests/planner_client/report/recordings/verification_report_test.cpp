// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/recordings/verification_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/escaping.h"
#include "tests/planner_client/report/diagnosis/sample_diagnosis.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string Render(const v1::Verification& verification) {
  const auto html = RenderVerificationReport(verification);
  EXPECT_TRUE(html.ok()) << html.status();
  EXPECT_EQ(MarkupFault(html.value_or("")), "");
  return html.value_or("");
}

TEST(VerificationReport, SaysHowFarTheSimulationIsOff) {
  const std::string html = Render(SampleVerification());
  EXPECT_THAT(html, HasSubstr("The simulated intensity is <strong>11\u202f% too low</strong> on "
                              "average"));
  EXPECT_THAT(html, HasSubstr("\u221212\u202f%"));
  EXPECT_THAT(html, HasSubstr("Two recordings are saturated"));
  v1::Verification high = SampleVerification();
  for (v1::ChannelSummary& summary : *high.mutable_summary()) summary.set_mean_e_i(-0.2);
  EXPECT_THAT(Render(high), HasSubstr("<strong>20\u202f% too high</strong>"));
}

TEST(VerificationReport, PlotsEveryChannelAgainstEveryParameter) {
  const std::string html = Render(SampleVerification());
  const std::string charts = html.substr(html.find("id=\"dependence\""),
                                         html.find("id=\"recordings\"") - html.find("id=\"depend"));
  // Four quantities against four parameters, 16 recordings a channel; two have simulated values.
  // The key has one more of each.
  for (const char* channel : {"red", "green", "blue"}) {
    EXPECT_EQ(CountOf(charts, std::string("class=\"dot ") + channel), 4u * 4 * 16 + 1);
    EXPECT_EQ(CountOf(charts, std::string("class=\"hollow ") + channel), 2u * 4 * 16 + 1);
  }
  for (const char* axis :
       {"camera distance [mm]", "focus distance [mm]", ">f-number<", "normalised exposure [ms]"}) {
    EXPECT_EQ(CountOf(charts, axis), std::string(axis)[0] == '>' ? 4u : 8u) << axis;  // and aria
  }
}

TEST(VerificationReport, ShowsProfilesAndCropsOfEveryRecording) {
  v1::Verification verification = SampleVerification();
  verification.mutable_recordings(3)->set_recorded_crop_png("recorded bytes");
  verification.mutable_recordings(3)->set_simulated_crop_png("simulated bytes");
  const std::string html = Render(verification);
  const std::string cards = html.substr(html.find("id=\"recordings\""));
  EXPECT_EQ(CountOf(cards, "class=\"line red\""), 16u + 1);
  EXPECT_EQ(CountOf(cards, "class=\"line dashed red\""), 16u + 1);
  EXPECT_EQ(CountOf(cards, "<img"), 2u);
  EXPECT_THAT(cards, HasSubstr("data:image/png;base64," + absl::Base64Escape("recorded bytes")));
  EXPECT_THAT(cards, HasSubstr("data:image/png;base64," + absl::Base64Escape("simulated bytes")));
  EXPECT_THAT(cards, HasSubstr("f/2.8, 3\u202fms, camera 400\u202fmm, focus 350\u202fmm"));
}

TEST(VerificationReport, LeavesOutWhatWasNotDetected) {
  v1::Verification verification = SampleVerification();
  v1::ChannelVerification* channel = verification.mutable_recordings(0)->mutable_channels(1);
  channel->clear_recorded_u_px();
  channel->clear_e_u();
  verification.mutable_summary(0)->clear_mean_e_u();
  const std::string html = Render(verification);
  EXPECT_EQ(CountOf(html, "class=\"dot green\""), 4u * 4 * 16 + 1 - 2 * 4);
  EXPECT_THAT(html, HasSubstr("<td>\u2013 / 0.240</td><td>\u2013</td><td>100 / 100</td>"));
  EXPECT_THAT(html, HasSubstr("<td>87 / 100</td>"));
  for (v1::ChannelSummary& summary : *verification.mutable_summary()) summary.clear_mean_e_u();
  EXPECT_THAT(Render(verification), HasSubstr("scatter of the line could not be compared"));
}

TEST(VerificationReport, HasNoEmptySections) {
  const std::string html = Render(v1::Verification());
  EXPECT_EQ(CountOf(html, "<section"), 1u);
  EXPECT_EQ(CountOf(html, "<svg"), 0u);
  v1::Verification bare;
  bare.add_recordings();
  bare.add_recordings()->add_channels();
  bare.add_summary();
  Render(bare);
}

TEST(VerificationReport, EscapesEveryText) {
  v1::Verification verification = SampleVerification();
  SetAllTexts(&verification, "<script>alert('x')</script>&\"");
  EXPECT_THAT(Render(verification), Not(HasSubstr("<script")));
}

TEST(VerificationReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::Verification verification = SampleVerification();
    SetAllNumbers(&verification, value);
    Render(verification);
  }
}

TEST(VerificationReport, LoadsNothingAndRunsNothing) {
  const std::string html = Render(SampleVerification());
  EXPECT_EQ(OutsideReference(html), "");
}

TEST(VerificationReport, RefusesListsThatDoNotFitTogether) {
  v1::Verification verification = SampleVerification();
  verification.mutable_recordings(2)->mutable_channels(1)->add_simulated_dn(1);
  const auto html = RenderVerificationReport(verification);
  EXPECT_EQ(html.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(html.status().message()),
              HasSubstr("recordings[2].channels[1].simulated_dn has size 65, must be 64"));
}

}  // namespace
}  // namespace sightline
