// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/uncertainty/uncertainty_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "planner_client/report/plan/report.h"
#include "planner_client/report/uncertainty/inadmissible.h"
#include "tests/planner_client/report/uncertainty/sample_uncertainty.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostile[] = "<script>alert('x')</script>&\"";

std::string Render(const ReportData& data) {
  const auto html = RenderReport(data);
  EXPECT_TRUE(html.ok()) << html.status();
  return html.value_or("");
}

// Without embedded script and data: what a reader sees.
std::string Visible(const ReportData& data) {
  const std::string html = Render(data);
  const size_t begin = html.find("<body>");
  return html.substr(begin, html.find("<script") - begin);
}

nlohmann::json ViewerData(const std::string& html) {
  const std::string mark = "id=\"viewer-data\">";
  const size_t begin = html.find(mark) + mark.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
}

template <class T>
std::vector<T> Decode(const nlohmann::json& text) {
  std::string bytes;
  EXPECT_TRUE(absl::Base64Unescape(text.get<std::string>(), &bytes));
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

// Codes of the page's script: 0 or a length in steps of equal ratio.
double Length(uint16_t code, const nlohmann::json& uncertainty) {
  const double low = uncertainty["lowest_m"], high = uncertainty["highest_m"];
  return code == 0 ? 0 : low * std::pow(high / low, (code - 1) / 65534.0);
}

std::string OwnSections(const ReportData& data) {
  return absl::StrCat("<html>", UncertaintyCurveSection(data.plan), FeatureSection(data.plan, true),
                      InadmissibleSection(*data.uncertainty, data.measurable), "</html>");
}

TEST(TargetUncertainty, ClassesIncludeTheirLimits) {
  TargetUncertainties u;
  u.total_m = {49e-6, 50e-6, 50.001e-6, 1e-3, 1.001e-3, 1e-6, 1e-6};
  u.admissible_m = {50e-6, 50e-6, 50e-6, 50e-6, 50e-6, 0, 50e-6};
  u.relaxed_m = 1e-3;
  TargetBits measurable(7);
  for (size_t i = 0; i < 6; ++i) measurable.Set(i);
  const std::vector<UncertaintyClass> expected = {
      UncertaintyClass::kAdmissible,   UncertaintyClass::kAdmissible, UncertaintyClass::kRelaxed,
      UncertaintyClass::kRelaxed,      UncertaintyClass::kNotReached, UncertaintyClass::kNotJudged,
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
  ReportData data = SampleUncertaintyPlan();
  const std::string html = Visible(data);
  // 19 of 89 toleranced targets.
  EXPECT_THAT(html,
              HasSubstr("<strong>2 scans make 21.3\u202f%</strong> of the toleranced surface"));
  EXPECT_THAT(html, HasSubstr("short of the goal of 80\u202f%: further scans would have added"));
  EXPECT_THAT(html,
              HasSubstr("On 1\u202f234 targets that the search has not seen it is 20.0\u202f%"));
  EXPECT_THAT(html, HasSubstr("3 of 5 tolerances can be proven"));
  EXPECT_THAT(html, HasSubstr("<dt>within 1\u202fmm</dt>"));
  // The coverage is told too, without the goal of plans for coverage.
  EXPECT_THAT(html, HasSubstr("The scans measure 79.8\u202f%"));
  EXPECT_THAT(html, Not(HasSubstr("95\u202f%")));
}

TEST(UncertaintyReport, FindingNamesBoundOnlyWhenConverged) {
  ReportData data = SampleUncertaintyPlan();
  v1::PlanUncertainty& uncertainty = *data.plan.mutable_uncertainty();
  uncertainty.mutable_bound()->set_scans(2.2);
  EXPECT_THAT(Visible(data), HasSubstr("not proven to be a bound"));
  uncertainty.mutable_bound()->set_converged(true);
  EXPECT_THAT(Visible(data), HasSubstr("a plan for 80\u202f% needs at least 3 scans"));
  uncertainty.mutable_bound()->set_scans(1.5);
  uncertainty.set_goal(0.2);
  EXPECT_THAT(Visible(data),
              HasSubstr("a plan for 20\u202f% needs at least 2 scans: no fewer than"));
}

TEST(UncertaintyReport, FeaturesThatCannotBeProvenComeFirst) {
  const std::string html = FeatureSection(SampleUncertaintyPlan().plan, true);
  // Excess over the admissible uncertainty: infinite, 71/50; then 24/25, 60/75, 10/25.
  size_t at = 0;
  for (const char* name : {"pocket", "bore", "edge", "rail", "top"}) {
    const size_t found = html.find(absl::StrCat("<strong>", name, "</strong>"));
    ASSERT_NE(found, std::string::npos) << name;
    EXPECT_GT(found, at) << name;
    at = found;
  }
  // Rows point to the plan's order, not to the table's.
  EXPECT_THAT(html, HasSubstr("data-feature=\"3\"><td class=\"words\"><strong>pocket"));
  EXPECT_THAT(html, HasSubstr("u exceeds the admissible 50 um"));
  EXPECT_THAT(html, HasSubstr(">71.0</td><td>42.6</td><td>0</td><td>56.8</td><td>50.0<"));
  EXPECT_THAT(html, HasSubstr("empty"));
  EXPECT_THAT(FeatureSection(SampleUncertaintyPlan().plan, false), Not(HasSubstr("data-feature")));
  EXPECT_EQ(FeatureSection(v1::Plan(), true), "");
}

TEST(UncertaintyReport, CountsWhyTargetsAreNotAdmissible) {
  const ReportData data = SampleUncertaintyPlan();
  const std::string html = OwnSections(data);
  EXPECT_THAT(html, HasSubstr("70 of 89 toleranced targets"));
  const auto row = [&](const std::string& begin) {
    const size_t at = html.find("<td class=\"words\">" + begin);
    return html.substr(at, html.find("</tr>", at) - at);
  };
  // Targets, share, only relaxed, not reached, u over the admissible.
  EXPECT_THAT(row("not measured by any scan"),
              HasSubstr("<td>20</td><td>22.5\u202f%</td><td>0</td><td>20</td><td>200.00</td>"));
  EXPECT_THAT(row("noise: fewer points"),
              HasSubstr("<td>10</td><td>11.2\u202f%</td><td>10</td><td>0</td><td>1.20</td>"));
  EXPECT_THAT(row("noise: points less certain"),
              HasSubstr("<td>10</td><td>11.2\u202f%</td><td>10</td><td>0</td><td>1.20</td>"));
  EXPECT_THAT(row("sampling"), HasSubstr("<td>10</td><td>11.2\u202f%</td><td>0</td><td>10</td>"));
  EXPECT_THAT(row("calibration"),
              HasSubstr("<td>20</td><td>22.5\u202f%</td><td>20</td><td>0</td><td>2.00</td>"));

  TargetUncertainties free = *data.uncertainty;
  free.admissible_m.assign(100, 0);
  EXPECT_THAT(InadmissibleSection(free, data.measurable), HasSubstr("No tolerance binds"));
  free.admissible_m.assign(100, 1);
  EXPECT_THAT(InadmissibleSection(free, data.measurable),
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
  // Not covered, not judged, not measurable.
  TargetBits covered = all, measurable = all;
  covered.Reset(4);
  measurable.Reset(3);
  u.admissible_m[5] = 0;
  u.limits = UncertaintyLimits(u, measurable, covered, points, regions);
  EXPECT_THAT(std::span(u.limits).subspan(3),
              ElementsAre(v1::UNCERTAINTY_LIMIT_UNSPECIFIED, v1::UNCERTAINTY_LIMIT_NOT_COVERED,
                          v1::UNCERTAINTY_LIMIT_UNSPECIFIED, v1::UNCERTAINTY_LIMIT_NOISE));
}

TEST(UncertaintyReport, BarsStandOnEachOtherAndShowTheLastScan) {
  ReportData data = SampleUncertaintyPlan();
  while (data.plan.scans_size() < 101) *data.plan.add_scans() = data.plan.scans(1);
  const std::string html = UncertaintyCurveSection(data.plan);
  const std::regex bar(
      "after scan ([0-9]+): [^\\n]*class=\"admissible\" x=\"[0-9.]+\" y=\"([0-9.]+)\" "
      "width=\"[0-9.]+\" height=\"([0-9.]+)\"/><rect class=\"relaxed\" x=\"[0-9.]+\" "
      "y=\"([0-9.]+)\" width=\"[0-9.]+\" height=\"([0-9.]+)\"");
  int bars = 0, last = 0;
  for (auto it = std::sregex_iterator(html.begin(), html.end(), bar); it != std::sregex_iterator();
       ++it, ++bars) {
    last = std::stoi((*it)[1]);
    if (last == 1) continue;
    const double low_y = std::stod((*it)[2]), low = std::stod((*it)[3]);
    const double high_y = std::stod((*it)[4]), high = std::stod((*it)[5]);
    EXPECT_NEAR(high_y + high, low_y, 0.11);
    // 19 admissible and 40 more relaxed targets of 89.
    EXPECT_NEAR(high / low, 40.0 / 19, 0.02);
  }
  EXPECT_LE(bars, 24);
  EXPECT_GE(bars, 12);
  EXPECT_EQ(last, 101);
}

TEST(UncertaintyReport, CurveHasBothLinesAndTheFreshValue) {
  const std::string html = UncertaintyCurveSection(SampleUncertaintyPlan().plan);
  EXPECT_THAT(html, HasSubstr("admissible 21.3"));
  EXPECT_THAT(html, HasSubstr("relaxed 66.3"));
  EXPECT_THAT(html, HasSubstr("on targets that the search has not seen: 20.00 %"));
  EXPECT_THAT(html, HasSubstr("goal 80 %"));
  v1::Plan plan;
  plan.mutable_uncertainty()->set_goal(0.5);
  EXPECT_EQ(MarkupFault(absl::StrCat("<html>", UncertaintyCurveSection(plan), "</html>")), "");
}

TEST(UncertaintyReport, SectionsAreWellFormedWhateverThePlanSays) {
  ReportData data = SampleUncertaintyPlan();
  EXPECT_EQ(MarkupFault(OwnSections(data)), "");
  SetAllTexts(&data.plan, kHostile);
  EXPECT_EQ(MarkupFault(OwnSections(data)), "");
  EXPECT_THAT(Render(data), Not(HasSubstr("<script>alert")));
  for (const double value : kOddNumbers) {
    v1::PlanUncertainty& uncertainty = *data.plan.mutable_uncertainty();
    for (v1::FeatureVerdict& feature : *uncertainty.mutable_features())
      SetAllNumbers(&feature, value);
    EXPECT_EQ(MarkupFault(absl::StrCat("<html>", FeatureSection(data.plan, true), "</html>")), "")
        << value;
  }
}

TEST(UncertaintyReport, PlansForCoverageShowNothingOfIt) {
  ReportData data = SampleUncertaintyPlan();
  data.plan.clear_uncertainty();
  data.uncertainty.reset();
  const std::string html = Visible(data);
  for (const char* id : {"id=\"uncertainty\"", "id=\"features\"", "id=\"inadmissible\""})
    EXPECT_THAT(html, Not(HasSubstr(id)));
  EXPECT_FALSE(ViewerData(Render(data)).contains("uncertainty"));
  EXPECT_THAT(html, HasSubstr("2 scans measure 79.8\u202f%"));
  EXPECT_THAT(html, Not(HasSubstr("has not seen")));
  data.plan.mutable_coverage()->set_fresh_coverage(0.777);
  data.plan.mutable_coverage()->set_fresh_measurable_targets(4321);
  EXPECT_THAT(Visible(data),
              HasSubstr("On 4\u202f321 targets that the search has not seen it is 77.7\u202f%"));
}

TEST(UncertaintyReport, ViewerGetsLengthsToAFewHundredthsOfAPercent) {
  const ReportData data = SampleUncertaintyPlan();
  const nlohmann::json json = ViewerData(Render(data))["uncertainty"];
  for (const auto& [name, expected] : {std::pair{"total", &data.uncertainty->total_m},
                                       std::pair{"noise", &data.uncertainty->noise_m},
                                       std::pair{"sampling", &data.uncertainty->sampling_m},
                                       std::pair{"calibration", &data.uncertainty->calibration_m},
                                       std::pair{"admissible", &data.uncertainty->admissible_m}}) {
    const std::vector<uint16_t> codes = Decode<uint16_t>(json[name]);
    ASSERT_EQ(codes.size(), 100u);
    for (size_t i = 0; i < codes.size(); ++i)
      EXPECT_NEAR(Length(codes[i], json), (*expected)[i], 2e-4 * (*expected)[i]) << name << i;
  }
  const std::vector<uint8_t> classes = Decode<uint8_t>(json["classes"]);
  ASSERT_EQ(classes.size(), 100u);
  for (size_t i = 0; i < classes.size(); ++i) {
    EXPECT_EQ(classes[i],
              static_cast<uint8_t>(ClassOfTarget(*data.uncertainty, data.measurable, i)));
  }
  ASSERT_EQ(json["features"].size(), 5u);
  EXPECT_EQ(Decode<uint32_t>(json["features"][2]["targets"]), (std::vector<uint32_t>{20, 25}));
}

TEST(UncertaintyReport, ViewerGetsTheMeasuredPointNearestToEachCoveredTarget) {
  const ReportData data = SampleUncertaintyPlan();
  const nlohmann::json json = ViewerData(Render(data))["uncertainty"];
  ASSERT_EQ(json["sensitivities"].size(), 2u);
  EXPECT_TRUE(json["sensitivities"][1].is_null());
  const std::vector<uint16_t> detection = Decode<uint16_t>(json["sensitivities"][0]["detection"]);
  for (size_t i = 0; i < 100; ++i) {
    const double expected =
        data.scans[0].covered.Test(i) ? 1e-6 * (100.0 + static_cast<double>(i)) : 0;
    EXPECT_NEAR(Length(detection[i], json), expected, 2e-4 * expected) << i;
  }
}

TEST(UncertaintyReport, SameDataSameBytes) {
  EXPECT_EQ(Render(SampleUncertaintyPlan()), Render(SampleUncertaintyPlan()));
}

TEST(UncertaintyReport, RefusesUncertaintiesThatDoNotFit) {
  const auto message = [](const ReportData& data) {
    const auto html = RenderReport(data);
    EXPECT_EQ(html.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(html.status().message());
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
  EXPECT_THAT(UncertaintyFinding(plan, ""),
              HasSubstr("3 of 5 tolerances can be proven; 1 not evaluated."));
  const std::string html = FeatureSection(plan, false);
  const size_t row = html.find("pocket"), end = html.find("</tr>", row);
  ASSERT_NE(row, std::string::npos);
  // It comes first, and of its figures only the zone is known.
  EXPECT_LT(row, html.find("bore"));
  const std::string cells = html.substr(row, end - row);
  EXPECT_THAT(cells, AllOf(HasSubstr("not evaluated"), HasSubstr("its datum H binds no face"),
                           Not(HasSubstr("cannot be proven")), Not(HasSubstr("<td>0"))));
  size_t unknown = 0;
  for (size_t at = cells.find("\u2013"); at != std::string::npos; at = cells.find("\u2013", at + 1))
    ++unknown;
  EXPECT_EQ(unknown, 10u);
  const std::string lines = SummariseVerdicts(plan.uncertainty());
  EXPECT_THAT(lines, HasSubstr("tolerances: 3 of 5 tolerances can be proven; 1 not evaluated."));
  EXPECT_THAT(lines, HasSubstr("  pocket (cylindricity 0.05 mm) not evaluated: its datum H"));
}

}  // namespace
}  // namespace sightline
