// SPDX-License-Identifier: Apache-2.0
#include "report/verification/verification_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tests/report/diagnosis/sample_diagnosis.h"
#include "tests/report/report_reading.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

using Mark = v1::ReportSeries;

constexpr v1::ReportColour kChannelColours[] = {v1::REPORT_COLOUR_RED, v1::REPORT_COLOUR_GREEN,
                                                v1::REPORT_COLOUR_BLUE};

v1::Report Made(const v1::Verification& verification) {
  auto report = VerificationReport(verification);
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  EXPECT_EQ(ReportFault(*report), "");
  return *report;
}

TEST(VerificationReport, SaysHowFarTheSimulationIsOff) {
  const v1::Report report = Made(SampleVerification());
  EXPECT_THAT(FindingOf(report),
              HasSubstr("The simulated intensity is 11\u202f% too low on average"));
  EXPECT_THAT(TextOf(SectionOf(report, "summary")), HasSubstr("\u221212\u202f%"));
  ASSERT_EQ(report.warnings_size(), 1);
  EXPECT_THAT(report.warnings(0), HasSubstr("Two recordings are saturated"));
  v1::Verification high = SampleVerification();
  for (v1::ChannelSummary& summary : *high.mutable_summary()) summary.set_mean_e_i(-0.2);
  EXPECT_THAT(FindingOf(Made(high)), HasSubstr("20\u202f% too high"));
}

TEST(VerificationReport, PlotsEveryChannelAgainstEveryParameter) {
  const auto charts = ChartsOf(SectionOf(Made(SampleVerification()), "dependence"));
  // Four quantities against four parameters, 16 recordings a channel; two have simulated values.
  ASSERT_EQ(charts.size(), 16u);
  std::multiset<std::string> abscissae;
  for (const v1::ReportChart& chart : charts) {
    abscissae.insert(chart.x().title());
    const bool has_simulated = chart.y().unit() == "px" || chart.y().unit() == "\u00b5m";
    for (const v1::ReportColour colour : kChannelColours) {
      EXPECT_EQ(PointsOf(chart, colour, Mark::DOTS), 16);
      EXPECT_EQ(PointsOf(chart, colour, Mark::HOLLOW_DOTS), has_simulated ? 16 : 0);
    }
  }
  for (const char* title :
       {"camera distance", "focus distance", "f-number", "normalised exposure"}) {
    EXPECT_EQ(abscissae.count(title), 4u) << title;
  }
}

TEST(VerificationReport, ShowsProfilesAndCropsOfEveryRecording) {
  v1::Verification verification = SampleVerification();
  verification.mutable_recordings(3)->set_recorded_crop_png("recorded bytes");
  verification.mutable_recordings(3)->set_simulated_crop_png("simulated bytes");
  const v1::Report cards = SectionOf(Made(verification), "recordings");
  const auto charts = ChartsOf(cards);
  ASSERT_EQ(charts.size(), 16u);
  for (size_t i = 0; i < charts.size(); ++i) {
    const auto& channel = verification.recordings(static_cast<int>(i)).channels(0);
    EXPECT_EQ(PointsOf(charts[i], v1::REPORT_COLOUR_RED, Mark::LINE), channel.row_px_size());
    EXPECT_EQ(PointsOf(charts[i], v1::REPORT_COLOUR_RED, Mark::DASHED_LINE), channel.row_px_size());
  }
  const auto pictures = PicturesOf(cards);
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(pictures[0].png(), "recorded bytes");
  EXPECT_EQ(pictures[1].png(), "simulated bytes");
  EXPECT_THAT(TextOf(cards), HasSubstr("f/2.8, 3\u202fms, camera 400\u202fmm, focus 350\u202fmm"));
}

TEST(VerificationReport, LeavesOutWhatWasNotDetected) {
  v1::Verification verification = SampleVerification();
  v1::ChannelVerification* channel = verification.mutable_recordings(0)->mutable_channels(1);
  channel->clear_recorded_u_px();
  channel->clear_e_u();
  verification.mutable_summary(0)->clear_mean_e_u();
  const v1::ReportTable table = TablesOf(SectionOf(Made(verification), "recordings"))[0];
  const v1::ReportCell recorded = CellOf(table, "green", "recorded");
  EXPECT_EQ(recorded.text(), "\u2013");
  EXPECT_FALSE(recorded.has_number());
  const v1::ReportCell simulated = CellOf(table, "green", "simulated");
  EXPECT_EQ(simulated.text(), "0.240");
  EXPECT_EQ(simulated.number(), channel->simulated_u_px());
  EXPECT_FALSE(CellOf(table, "green", "e\u1d64").has_number());
  for (v1::ChannelSummary& summary : *verification.mutable_summary()) summary.clear_mean_e_u();
  EXPECT_THAT(FindingOf(Made(verification)),
              HasSubstr("scatter of the line could not be compared"));
}

TEST(VerificationReport, HasNoEmptySections) {
  EXPECT_EQ(Made(v1::Verification()).sections_size(), 1);
  v1::Verification bare;
  bare.add_recordings();
  bare.add_recordings()->add_channels();
  bare.add_summary();
  Made(bare);
}

TEST(VerificationReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::Verification verification = SampleVerification();
    SetAllNumbers(&verification, value);
    Made(verification);
  }
}

TEST(VerificationReport, RefusesListsThatDoNotFitTogether) {
  v1::Verification verification = SampleVerification();
  verification.mutable_recordings(2)->mutable_channels(1)->add_simulated_dn(1);
  const auto report = VerificationReport(verification);
  EXPECT_EQ(report.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(report.status().message()),
              HasSubstr("recordings[2].channels[1].simulated_dn has size 65, must be 64"));
}

}  // namespace
}  // namespace sightline
