// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/uncertainty_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/json/strict_json.h"
#include "report/document/report_page.h"
#include "report/plan/report.h"
#include "report/uncertainty/inadmissible.h"
#include "tests/report/report_reading.h"
#include "tests/report/uncertainty/sample_uncertainty.h"
#include "tests/report/unpacked_numbers.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostile[] = "<script>alert('x')</script>&\"";

v1::Report Made(const ReportData& data) {
  const auto report = PlanReport(data);
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  EXPECT_EQ(ReportFault(*report), "");
  return *report;
}

v1::SceneUncertainty SceneOf(const ReportData& data) {
  return SectionOf(Made(data), "view").sections(0).blocks(0).scene().uncertainty();
}

std::vector<double> LengthsOf(const v1::SceneLengths& packed) {
  std::vector<double> lengths_m;
  for (const uint16_t code : UnpackNumbers<uint16_t>(packed.codes())) {
    lengths_m.push_back(code == 0
                            ? 0
                            : packed.lowest_m() * std::pow(packed.highest_m() / packed.lowest_m(),
                                                           (code - 1) / 65534.0));
  }
  return lengths_m;
}

// The blocks as a report of one section.
v1::Report ReportOf(const ReportBlocks& blocks) {
  v1::Report report;
  report.set_title("blocks");
  report.set_kind("plan");
  AddSection(&report, "blocks", "Blocks", blocks);
  EXPECT_EQ(ReportFault(report), "");
  return report;
}

TEST(TargetUncertainty, ClassesIncludeTheirLimits) {
  TargetUncertainties u;
  u.total_m = {49e-6, 50e-6, 50.001e-6, 1e-3, 1.001e-3, 1e-6, 1e-6};
  u.admissible_m = {50e-6, 50e-6, 50e-6, 50e-6, 50e-6, 0, 50e-6};
  u.relaxed_m = 1e-3;
  TargetBits measurable(7);
  for (size_t i = 0; i < 6; ++i) measurable.Set(i);
  const std::vector<UncertaintyClass> expected = {
      UncertaintyClass::kAdmissible,   UncertaintyClass::kAdmissible,
      UncertaintyClass::kRelaxed,      UncertaintyClass::kRelaxed,
      UncertaintyClass::kNotReached,   UncertaintyClass::kNotToleranced,
      UncertaintyClass::kNotMeasurable};
  for (size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(ClassOfTarget(u, measurable, i), expected[i]) << i;
}

TEST(TargetUncertainty, DominatingPartIsTheLargestAndOfEqualOnesTheFirst) {
  TargetUncertainties u;
  u.noise_m = {3, 1, 1, 2};
  u.sampling_m = {2, 3, 1, 2};
  u.calibration_m = {1, 2, 3, 2};
  EXPECT_EQ(DominatingPart(u, 0), UncertaintyPart::kNoise);
  EXPECT_EQ(DominatingPart(u, 1), UncertaintyPart::kSampling);
  EXPECT_EQ(DominatingPart(u, 2), UncertaintyPart::kCalibration);
  EXPECT_EQ(DominatingPart(u, 3), UncertaintyPart::kNoise);
}

TEST(UncertaintyReport, LengthsAreShownInMicrometresOrMillimetres) {
  EXPECT_EQ(LengthText(12.34e-6), "12.3\u202f\u00b5m");
  EXPECT_EQ(LengthText(999e-6), "999\u202f\u00b5m");
  EXPECT_EQ(LengthText(0.9996e-3), "1.00\u202fmm");
  EXPECT_EQ(LengthText(0.01), "10.0\u202fmm");
  EXPECT_EQ(LengthText(std::numeric_limits<double>::infinity()), "\u2013");
}

TEST(UncertaintyReport, SaysHowMuchIsKnownAlsoOnFreshTargets) {
  const v1::Report report = Made(SampleUncertaintyPlan());
  const std::string finding = FindingOf(report);
  // 19 of 89 toleranced targets.
  EXPECT_THAT(
      finding,
      AllOf(HasSubstr("2 scans make 21.3\u202f% of the toleranced surface"),
            HasSubstr("short of the goal of 80\u202f%: further scans would have added"),
            HasSubstr("On 1\u202f234 targets that the search has not seen it is 20.0\u202f%"),
            HasSubstr("3 of 5 tolerances can be proven"),
            // The coverage is told too, without the goal of plans for coverage.
            HasSubstr("The scans measure 79.8\u202f%"), Not(HasSubstr("95\u202f%"))));
  EXPECT_EQ(report.figures(3).name(), "within 1\u202fmm");
}

TEST(UncertaintyReport, FindingNamesBoundOnlyWhenConverged) {
  ReportData data = SampleUncertaintyPlan();
  v1::PlanUncertainty& uncertainty = *data.plan.mutable_uncertainty();
  uncertainty.mutable_bound()->set_scans(2.2);
  EXPECT_THAT(FindingOf(Made(data)), HasSubstr("not proven to be a bound"));
  uncertainty.mutable_bound()->set_converged(true);
  EXPECT_THAT(FindingOf(Made(data)), HasSubstr("a plan for 80\u202f% needs at least 3 scans"));
  uncertainty.mutable_bound()->set_scans(1.5);
  uncertainty.set_goal(0.2);
  EXPECT_THAT(FindingOf(Made(data)),
              HasSubstr("a plan for 20\u202f% needs at least 2 scans: no fewer than"));
}

TEST(UncertaintyReport, FeaturesThatCannotBeProvenComeFirst) {
  const v1::Plan plan = SampleUncertaintyPlan().plan;
  const v1::ReportTable table = TablesOf(ReportOf(FeatureBlocks(plan, true))).at(0);
  // Excess over the admissible uncertainty: infinite, 71/50; then 24/25, 60/75, 10/25.
  std::vector<std::string> names;
  for (const v1::ReportRow& row : table.rows()) names.push_back(row.cells(0).text());
  EXPECT_THAT(names, ElementsAre("pocket", "bore", "edge", "rail", "top"));
  // Rows point to the plan's order, not to the table's.
  EXPECT_EQ(table.rows(0).view().feature(), 3);
  EXPECT_EQ(CellOf(table, "pocket", "acceptance").text(), "empty");
  const v1::ReportCell verdict = CellOf(table, "bore", "verdict");
  EXPECT_THAT(verdict.detail(), HasSubstr("u exceeds the admissible 50 um"));
  EXPECT_EQ(verdict.state(), v1::REPORT_STATE_BAD);
  EXPECT_EQ(CellOf(table, "bore", "u").text(), "71.0");
  EXPECT_EQ(CellOf(table, "bore", "noise").text(), "42.6");
  EXPECT_EQ(CellOf(table, "bore", "sampling").text(), "0");
  EXPECT_EQ(CellOf(table, "bore", "calibration").text(), "56.8");
  EXPECT_EQ(CellOf(table, "bore", "admissible").text(), "50.0");
  const v1::ReportTable fixed = TablesOf(ReportOf(FeatureBlocks(plan, false))).at(0);
  EXPECT_FALSE(fixed.rows(0).has_view());
  EXPECT_TRUE(FeatureBlocks(v1::Plan(), true).empty());
}

TEST(UncertaintyReport, CountsWhyTargetsAreNotAdmissible) {
  const ReportData data = SampleUncertaintyPlan();
  const v1::Report report = ReportOf(InadmissibleBlocks(*data.uncertainty, data.measurable));
  EXPECT_THAT(TextOf(report), HasSubstr("70 of 89 toleranced targets"));
  const v1::ReportTable table = TablesOf(report).at(0);
  const auto row = [&](const std::string& begin) {
    std::vector<std::string> texts;
    for (const v1::ReportRow& candidate : table.rows()) {
      if (!candidate.cells(0).text().starts_with(begin)) continue;
      for (int i = 1; i < 6; ++i) texts.push_back(candidate.cells(i).text());
      break;
    }
    return texts;
  };
  // Targets, share, only relaxed, not reached, u over the admissible.
  EXPECT_THAT(row("not measured by any scan"),
              ElementsAre("20", "22.5\u202f%", "0", "20", "200.00"));
  EXPECT_THAT(row("noise: fewer points"), ElementsAre("10", "11.2\u202f%", "10", "0", "1.20"));
  EXPECT_THAT(row("noise: points less certain"),
              ElementsAre("10", "11.2\u202f%", "10", "0", "1.20"));
  EXPECT_THAT(row("sampling"), ElementsAre("10", "11.2\u202f%", "0", "10", _));
  EXPECT_THAT(row("calibration"), ElementsAre("20", "22.5\u202f%", "20", "0", "2.00"));

  TargetUncertainties free = *data.uncertainty;
  free.admissible_m.assign(100, 0);
  EXPECT_THAT(TextOf(ReportOf(InadmissibleBlocks(free, data.measurable))),
              HasSubstr("No tolerance binds"));
  free.admissible_m.assign(100, 1);
  EXPECT_THAT(TextOf(ReportOf(InadmissibleBlocks(free, data.measurable))),
              HasSubstr("every toleranced target is admissible"));
}

TEST(UncertaintyLimits, NoiseIsComparedWithWhatIsKnown) {
  // Targets 0 to 2 are known to 20 um by 100 points; admissible are 25 um.
  TargetUncertainties u;
  u.noise_m = {20e-6, 20e-6, 20e-6, 30e-6, 30e-6, 20e-6, 30e-6};
  u.sampling_m.assign(7, 0);
  u.calibration_m.assign(7, 0);
  u.total_m = u.noise_m;
  u.admissible_m = {25e-6, 25e-6, 25e-6, 25e-6, 25e-6, 10e-6, 25e-6};
  TargetBits all(7);
  for (size_t t = 0; t < 7; ++t) all.Set(t);
  // As certain as theirs but fewer; as many but less certain; as theirs under a narrower tolerance;
  // alone in its region, with nothing known there to compare with.
  const std::vector<int32_t> points = {100, 100, 100, 44, 100, 100, 44};
  const std::vector<int32_t> regions = {-1, -1, -1, -1, -1, -1, 0};
  u.limits = UncertaintyLimits(u, all, all, points, regions);
  EXPECT_THAT(u.limits,
              ElementsAre(v1::UNCERTAINTY_LIMIT_UNSPECIFIED, v1::UNCERTAINTY_LIMIT_UNSPECIFIED,
                          v1::UNCERTAINTY_LIMIT_UNSPECIFIED, v1::UNCERTAINTY_LIMIT_FEW_POINTS,
                          v1::UNCERTAINTY_LIMIT_POINT_NOISE, v1::UNCERTAINTY_LIMIT_TOLERANCE,
                          v1::UNCERTAINTY_LIMIT_NOISE));
  const std::vector<v1::InadmissibleCount> counts = CountInadmissible(u);
  ASSERT_EQ(counts.size(), 4u);
  EXPECT_EQ(counts[0].limit(), v1::UNCERTAINTY_LIMIT_NOISE);
  EXPECT_EQ(counts[0].targets(), 1);
  EXPECT_NEAR(counts[0].median_uncertainty_over_admissible(), 1.2, 1e-9);
  v1::PlanUncertainty message;
  for (const v1::InadmissibleCount& count : counts) *message.add_inadmissible() = count;
  EXPECT_THAT(
      SummariseInadmissible(message),
      AllOf(HasSubstr("4 toleranced targets are not known well enough: noise of line detection"),
            HasSubstr("(1, u 1.2 times the admissible)"), HasSubstr("(1, u 2 times")));
  EXPECT_EQ(SummariseInadmissible({}), "");
  // Not covered, not toleranced, not measurable.
  TargetBits covered = all, measurable = all;
  covered.Reset(4);
  measurable.Reset(3);
  u.admissible_m[5] = 0;
  u.limits = UncertaintyLimits(u, measurable, covered, points, regions);
  EXPECT_THAT(std::span(u.limits).subspan(3),
              ElementsAre(v1::UNCERTAINTY_LIMIT_UNSPECIFIED, v1::UNCERTAINTY_LIMIT_NOT_COVERED,
                          v1::UNCERTAINTY_LIMIT_UNSPECIFIED, v1::UNCERTAINTY_LIMIT_NOISE));
}

TEST(UncertaintyReport, CurveHasBothLinesAndTheFreshValue) {
  const v1::ReportChart chart =
      ChartsOf(ReportOf(UncertaintyCurveBlocks(SampleUncertaintyPlan().plan))).at(0);
  ASSERT_EQ(chart.series_size(), 4);
  EXPECT_NEAR(chart.series(1).y(1), 100 * 59.0 / 89, 1e-9);  // relaxed
  EXPECT_NEAR(chart.series(2).y(1), 100 * 19.0 / 89, 1e-9);  // admissible
  EXPECT_TRUE(chart.series(2).of_scans());
  EXPECT_NEAR(chart.series(3).y(0), 20, 1e-9);
  EXPECT_EQ(chart.lines(0).name(), "goal 80\u202f%");
  v1::Plan plan;
  plan.mutable_uncertainty()->set_goal(0.5);
  ReportOf(UncertaintyCurveBlocks(plan));
}

TEST(UncertaintyReport, SectionsHoldWhateverThePlanSays) {
  ReportData data = SampleUncertaintyPlan();
  SetAllTexts(&data.plan, kHostile);
  EXPECT_THAT(ReportPage(Made(data), "report.json"), Not(HasSubstr("<script>alert")));
  for (const double value : kOddNumbers) {
    v1::PlanUncertainty& uncertainty = *data.plan.mutable_uncertainty();
    for (v1::FeatureVerdict& feature : *uncertainty.mutable_features()) {
      SetAllNumbers(&feature, value);
    }
    ReportOf(FeatureBlocks(data.plan, true));
  }
}

TEST(UncertaintyReport, PlansForCoverageShowNothingOfIt) {
  ReportData data = SampleUncertaintyPlan();
  data.plan.clear_uncertainty();
  data.uncertainty.reset();
  const v1::Report report = Made(data);
  for (const char* id : {"uncertainty", "features", "inadmissible"}) {
    EXPECT_EQ(SectionOf(report, id).sections_size(), 0) << id;
  }
  EXPECT_FALSE(report.sections(0).blocks(0).scene().has_uncertainty());
  EXPECT_THAT(FindingOf(report),
              AllOf(HasSubstr("2 scans measure 79.8\u202f%"), Not(HasSubstr("has not seen"))));
  data.plan.mutable_coverage()->set_fresh_coverage(0.777);
  data.plan.mutable_coverage()->set_fresh_measurable_targets(4321);
  EXPECT_THAT(FindingOf(Made(data)),
              HasSubstr("On 4\u202f321 targets that the search has not seen it is 77.7\u202f%"));
}

TEST(UncertaintyReport, SceneHasLengthsToAFewHundredthsOfAPercent) {
  const ReportData data = SampleUncertaintyPlan();
  const v1::SceneUncertainty scene = SceneOf(data);
  for (const auto& [packed, expected] :
       {std::pair{&scene.total(), &data.uncertainty->total_m},
        std::pair{&scene.noise(), &data.uncertainty->noise_m},
        std::pair{&scene.sampling(), &data.uncertainty->sampling_m},
        std::pair{&scene.calibration(), &data.uncertainty->calibration_m},
        std::pair{&scene.admissible(), &data.uncertainty->admissible_m}}) {
    const std::vector<double> lengths_m = LengthsOf(*packed);
    ASSERT_EQ(lengths_m.size(), 100U);
    for (size_t i = 0; i < lengths_m.size(); ++i) {
      EXPECT_NEAR(lengths_m[i], (*expected)[i], 2e-4 * (*expected)[i]) << i;
    }
  }
  const std::vector<uint8_t> classes = UnpackNumbers<uint8_t>(scene.classes());
  ASSERT_EQ(classes.size(), 100U);
  for (size_t i = 0; i < classes.size(); ++i) {
    EXPECT_EQ(classes[i],
              static_cast<uint8_t>(ClassOfTarget(*data.uncertainty, data.measurable, i)));
  }
  ASSERT_EQ(scene.features_size(), 5);
  EXPECT_THAT(UnpackNumbers<uint32_t>(scene.features(2).targets()), ElementsAre(20, 25));
}

TEST(UncertaintyReport, SceneHasTheMeasuredPointNearestToEachCoveredTarget) {
  const ReportData data = SampleUncertaintyPlan();
  const v1::SceneUncertainty scene = SceneOf(data);
  ASSERT_EQ(scene.sensitivities_size(), 2);
  EXPECT_FALSE(scene.sensitivities(1).has_detection());
  const std::vector<double> detection_m = LengthsOf(scene.sensitivities(0).detection());
  for (size_t i = 0; i < 100; ++i) {
    const double expected =
        data.scans[0].covered.Test(i) ? 1e-6 * (100.0 + static_cast<double>(i)) : 0;
    EXPECT_NEAR(detection_m.at(i), expected, 2e-4 * expected) << i;
  }
}

TEST(UncertaintyReport, SameDataSameBytes) {
  EXPECT_EQ(ToJson(Made(SampleUncertaintyPlan())), ToJson(Made(SampleUncertaintyPlan())));
}

TEST(UncertaintyReport, RefusesUncertaintiesThatDoNotFit) {
  const auto message = [](const ReportData& data) {
    const auto report = PlanReport(data);
    EXPECT_EQ(report.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(report.status().message());
  };
  ReportData data = SampleUncertaintyPlan();
  data.uncertainty->sampling_m.pop_back();
  EXPECT_THAT(message(data), HasSubstr("sampling_m has size 99, must be 100"));
  data = SampleUncertaintyPlan();
  data.uncertainty->total_m[7] = -1e-6;
  EXPECT_THAT(message(data), HasSubstr("total_m[7] is -1e-06, must be finite and at least 0"));
  data = SampleUncertaintyPlan();
  data.uncertainty->noise_m[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(data), HasSubstr("noise_m[3] is nan"));
  data = SampleUncertaintyPlan();
  data.uncertainty->relaxed_m = std::numeric_limits<double>::infinity();
  EXPECT_THAT(message(data), HasSubstr("relaxed_m is inf"));
  data = SampleUncertaintyPlan();
  data.uncertainty->scan_sensitivities.pop_back();
  EXPECT_THAT(message(data), HasSubstr("scan_sensitivities has size 1, must be 2"));
  data = SampleUncertaintyPlan();
  data.uncertainty->scan_sensitivities[0].calibration_m.pop_back();
  EXPECT_THAT(message(data), HasSubstr("scan_sensitivities[0].calibration_m has size"));
  data = SampleUncertaintyPlan();
  data.uncertainty->scan_sensitivities[0].positions_m[0].x() = NAN;
  EXPECT_THAT(message(data), HasSubstr("scan_sensitivities[0].positions_m[0] is not finite"));
  data = SampleUncertaintyPlan();
  data.uncertainty->feature_targets[4].push_back(100);
  EXPECT_THAT(message(data), HasSubstr("feature_targets[4] names target 100; there are 100"));
  data = SampleUncertaintyPlan();
  data.uncertainty->feature_targets.pop_back();
  EXPECT_THAT(message(data), HasSubstr("feature_targets has size 4, must be 5"));
}

// A tolerance that is not evaluated: its own state, its own count and no figures.
TEST(UncertaintyReport, WhatIsNotEvaluatedHasNoFigures) {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  v1::FeatureVerdict& pocket = *plan.mutable_uncertainty()->mutable_features(3);
  v1::FeatureVerdict bare;
  bare.set_id(pocket.id());
  bare.set_name("pocket");
  bare.set_text("cylindricity 0.05 mm");
  bare.set_zone_width_m(5e-5);
  bare.set_verdict(v1::FeatureVerdict::NOT_EVALUATED);
  bare.set_because("not evaluated: its datum H binds no face");
  pocket = bare;
  EXPECT_THAT(UncertaintyFinding(plan, "").at(1).text(),
              HasSubstr("3 of 5 tolerances can be proven; 1 not evaluated."));
  // It comes first, and of its figures only the zone is known.
  const v1::ReportRow row = TablesOf(ReportOf(FeatureBlocks(plan, false))).at(0).rows(0);
  EXPECT_EQ(row.cells(0).text(), "pocket");
  EXPECT_EQ(row.cells(1).text(), "not evaluated");
  EXPECT_EQ(row.cells(1).state(), v1::REPORT_STATE_UNSPECIFIED);
  EXPECT_EQ(row.cells(1).detail(), "its datum H binds no face");
  EXPECT_EQ(row.cells(2).text(), "0.05");
  for (int i = 3; i < row.cells_size(); ++i) {
    EXPECT_EQ(row.cells(i).text(), "\u2013") << i;
    EXPECT_FALSE(row.cells(i).has_number()) << i;
  }
  const std::string lines = SummariseVerdicts(plan.uncertainty());
  EXPECT_THAT(lines, HasSubstr("tolerances: 3 of 5 tolerances can be proven; 1 not evaluated."));
  EXPECT_THAT(lines, HasSubstr("  pocket (cylindricity 0.05 mm) not evaluated: its datum H"));
}

}  // namespace
}  // namespace sightline
