// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "planner_client/report/charts/coverage_curve.h"
#include "planner_client/report/page/assets.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/plan/sections/quality_section.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostileTemplateText[] = "<script>alert('x')</script>&\"{{STYLE}}";

// A square plate of 10 x 10 targets. Scan k of 3 measures every target whose index is k modulo 3 in
// the first eight columns; nothing measures the last two. Targets 0 and 1 are not measurable.
ReportData Plate() {
  ReportData data;
  data.mesh.positions_m = {{0, 0, 0}, {0.05f, 0, 0}, {0.05f, 0.05f, 0}, {0, 0.05f, 0}};
  data.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (int i = 0; i < 100; ++i) {
    const int column = i % 10, row = i / 10;
    data.targets.positions_m.push_back({0.005f * column, 0.005f * row, 0});
    data.targets.normals.push_back({0, 0, 1});
    data.targets.regions.push_back(-1);
    data.targets.triangles.push_back(0);
  }
  data.measurable = TargetBits(100);
  for (size_t i = 2; i < 100; ++i) data.measurable.Set(i);
  data.part_name = "plate.glb";
  data.plan.set_inspection_name("plate");
  int64_t sum = 0;
  for (int k = 0; k < 3; ++k) {
    ReportScan extra;
    extra.covered = TargetBits(100);
    for (size_t i = 2; i < 100; ++i) {
      if (i % 10 < 8 && i % 3 == static_cast<size_t>(k)) extra.covered.Set(i);
    }
    extra.rendered_view_png = "not really a PNG";
    v1::PlannedScan* scan = data.plan.add_scans();
    scan->set_index(k + 1);
    scan->mutable_measurement()->set_camera_distance_m(0.3117 + 0.1 * k);
    scan->mutable_measurement()->set_triangulation_angle_deg(-10.25 - k);
    sum += extra.covered.Count();
    scan->set_covered_targets(extra.covered.Count());
    scan->set_new_targets(extra.covered.Count());
    scan->set_cumulative_targets(sum);
    scan->set_stage_start_m(-0.011);
    scan->set_stage_end_m(0.044);
    for (v1::Pose* pose :
         {scan->mutable_camera_pose(), scan->mutable_laser_pose(), scan->mutable_part_pose()}) {
      for (int i = 0; i < 16; ++i) pose->add_matrix(i % 5 == 0);
    }
    data.scans.push_back(std::move(extra));
  }
  v1::PlanCoverage* coverage = data.plan.mutable_coverage();
  coverage->set_targets(100);
  coverage->set_measurable_targets(98);
  coverage->set_covered_targets(sum);
  coverage->set_coverage(static_cast<double>(sum) / 98);
  coverage->set_goal(0.7);
  data.plan.set_stop_reason(v1::Plan::STOP_REASON_GOAL_REACHED);
  return data;
}

std::string Render(const ReportData& data) {
  const auto html = RenderReport(data);
  EXPECT_TRUE(html.ok()) << html.status();
  return html.value_or("");
}

// Without embedded script and data: what a reader sees.
std::string Visible(const std::string& html) {
  const size_t begin = html.find("<body>"), end = html.find("<script");
  EXPECT_NE(begin, std::string::npos);
  return html.substr(begin, end - begin);
}

nlohmann::json ViewerData(const std::string& html) {
  const std::string mark = "id=\"viewer-data\">";
  const size_t begin = html.find(mark) + mark.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
}

TEST(RenderReport, ShowsEveryScanWithParametersInMillimetresAndDegrees) {
  const std::string html = Visible(Render(Plate()));
  for (int k = 0; k < 3; ++k) {
    EXPECT_THAT(html, HasSubstr(absl::StrCat("data-scan=\"", k + 1, "\"><td")));
    EXPECT_THAT(html, HasSubstr(absl::StrCat(">", 311 + 100 * k, ".7<")));
    EXPECT_THAT(html, HasSubstr(absl::StrCat(">\u2212", 10 + k, ".25<")));
  }
  EXPECT_THAT(html, HasSubstr(">\u221211<"));
  EXPECT_THAT(html, HasSubstr(">44<"));
  EXPECT_THAT(html, HasSubstr("3 scans measure 79.6\u202f%"));
  EXPECT_THAT(html, HasSubstr(absl::StrCat("data:image/png;base64,",
                                           absl::Base64Escape("not really a PNG"))));
}

TEST(RenderReport, ListsUncoveredTargets) {
  const std::string html = Visible(Render(Plate()));
  EXPECT_THAT(html, HasSubstr("20 measurable targets in 1 connected region are not measured"));
  EXPECT_THAT(html, HasSubstr("data-region=\"0\""));
  EXPECT_THAT(html, HasSubstr("5 \u00d7 45 \u00d7 0"));
  EXPECT_THAT(html, HasSubstr("facing z+"));
}

// The plate with reasons: 5 of the 20 uncovered targets were not chosen, a clamp hides the others;
// the two that are not measurable are hidden by the part.
ReportData ExplainedPlate() {
  ReportData data = Plate();
  auto clamp = std::make_shared<TriangleMesh>();
  clamp->positions_m = {{0, 0, 0.1f}, {0.05f, 0, 0.1f}, {0, 0.05f, 0.1f}};
  clamp->triangles = {{0, 1, 2}};
  data.obstacles = {{kHostileTemplateText, v1::Obstacle::FRAME_PART, clamp},
                    {"table", v1::Obstacle::FRAME_TABLE, clamp}};
  data.reasons.resize(100);
  data.reasons[0] = data.reasons[1] = {v1::UNCOVERED_REASON_OWN_OCCLUSION, -1};
  int found = 0;
  for (size_t i = 2; i < 100; ++i) {
    if (i % 10 < 8) continue;
    data.reasons[i] = ++found <= 5 ? TargetReason{v1::UNCOVERED_REASON_NOT_CHOSEN, -1}
                                   : TargetReason{v1::UNCOVERED_REASON_OBSTACLE, 0};
  }
  const auto add = [](v1::UncoveredReason reason, const std::string& obstacle, int64_t targets,
                      bool measurable, auto* counts) {
    v1::UncoveredCount& count = *counts->Add();
    count.set_reason(reason);
    count.set_obstacle(obstacle);
    count.set_targets(targets);
    count.set_measurable(measurable);
  };
  v1::PlanCoverage& coverage = *data.plan.mutable_coverage();
  add(v1::UNCOVERED_REASON_OBSTACLE, kHostileTemplateText, 15, true, coverage.mutable_uncovered());
  add(v1::UNCOVERED_REASON_NOT_CHOSEN, "", 5, true, coverage.mutable_uncovered());
  add(v1::UNCOVERED_REASON_OWN_OCCLUSION, "", 2, false, coverage.mutable_uncovered());
  data.sampling.regions = {{"flange", {0, 0, 0}, {0.01, 0.01, 0}, 0.005}};
  v1::RegionCoverage& region = *coverage.add_regions();
  region.set_name("flange");
  region.set_targets(9);
  region.set_measurable_targets(7);
  region.set_covered_targets(7);
  add(v1::UNCOVERED_REASON_OWN_OCCLUSION, "", 2, false, region.mutable_uncovered());
  return data;
}

TEST(RenderReport, SaysWhyPlacesAreNotMeasured) {
  const std::string html = Render(ExplainedPlate());
  const std::string visible = Visible(html);
  EXPECT_THAT(visible, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(visible, HasSubstr("Why places are not measured"));
  // Reason, targets, share of all 100, measurable, not measurable.
  EXPECT_THAT(visible, HasSubstr("hidden by the part itself</td><td>2</td><td>2.0\u202f%</td><td>0"
                                 "</td><td>2</td>"));
  EXPECT_THAT(visible, HasSubstr("not measured</td><td>22</td><td>22.0\u202f%</td><td>20</td>"
                                 "<td>2</td>"));
  // The unmeasured region and what is not measurable.
  EXPECT_THAT(visible, HasSubstr("not chosen: other scans would measure it (5)"));
  EXPECT_THAT(visible,
              HasSubstr("The other 2 count neither for a scan nor against it: hidden by the "
                        "part itself (2)."));
  EXPECT_THAT(visible, HasSubstr("flange</td><td>9</td><td>7</td><td>7</td><td>77.8\u202f%</td>"));

  const nlohmann::json json = ViewerData(html);
  ASSERT_EQ(json["reasons"]["kinds"].size(), 3u);
  EXPECT_EQ(json["reasons"]["kinds"][0]["targets"], 15);
  std::string kinds;
  ASSERT_TRUE(absl::Base64Unescape(json["reasons"]["of_target"].get<std::string>(), &kinds));
  ASSERT_EQ(kinds.size(), 100u);
  EXPECT_EQ(kinds[0], 3);
  EXPECT_EQ(kinds[2], 0);
  EXPECT_EQ(kinds[8], 2);
  EXPECT_EQ(kinds[99], 1);
  ASSERT_EQ(json["regions_of_interest"].size(), 1u);
  EXPECT_EQ(json["regions_of_interest"][0]["name"], "flange");
}

TEST(RenderReport, DrawsObstaclesWhereTheyAreInEveryScan) {
  ReportData data = ExplainedPlate();
  for (v1::PlannedScan& scan : *data.plan.mutable_scans()) {
    scan.mutable_measurement()->set_offset_y_m(0.02);
    scan.mutable_measurement()->set_offset_z_m(0.03);
    scan.set_table_height_m(-0.04);
    // The part is turned by 90 degrees about z, and moved.
    scan.mutable_part_pose()->clear_matrix();
    for (const double value :
         {0., -1., 0., 0.5, 1., 0., 0., 0.25, 0., 0., 1., 0.125, 0., 0., 0., 1.}) {
      scan.mutable_part_pose()->add_matrix(value);
    }
  }
  data.obstacles.push_back({"gauge", v1::Obstacle::FRAME_STAGE, data.obstacles[0].mesh});
  data.obstacles.push_back({"frame", v1::Obstacle::FRAME_WORLD, data.obstacles[0].mesh});
  const nlohmann::json obstacles = ViewerData(Render(data))["obstacles"];
  ASSERT_EQ(obstacles.size(), 4u);
  EXPECT_TRUE(obstacles[0]["poses"][0].is_null());
  EXPECT_EQ(obstacles[1]["name"], "table");
  const auto origin = [&](size_t obstacle) {
    const auto m = obstacles[obstacle]["poses"][1].get<std::vector<double>>();
    return std::vector<double>{m[3], m[7], m[11]};
  };
  // World to part: x_part = y_world - 0.25, y_part = 0.5 - x_world, z_part = z_world - 0.125.
  EXPECT_EQ(origin(1), (std::vector<double>{0.02 - 0.25, 0.5, -0.04 - 0.125}));
  EXPECT_EQ(origin(2), (std::vector<double>{0.02 - 0.25, 0.5, 0.03 - 0.125}));
  EXPECT_EQ(origin(3), (std::vector<double>{-0.25, 0.5 - 0.011, -0.125}));  // starts at -11 mm
  EXPECT_TRUE(obstacles[3]["stands_still"].get<bool>());
}

TEST(RenderReport, FindingNamesBoundOnlyWhenConverged) {
  ReportData data = Plate();
  data.plan.mutable_bound()->set_scans(2.2);
  EXPECT_THAT(Visible(Render(data)), HasSubstr("not proven to be a bound"));
  EXPECT_THAT(Visible(Render(data)), Not(HasSubstr("lower bound")));
  data.plan.mutable_bound()->set_converged(true);
  EXPECT_THAT(Visible(Render(data)),
              HasSubstr("the lower bound (2.2) found, a plan for 70\u202f% needs at least 3 scans: "
                        "no fewer than this one."));
  data.plan.mutable_bound()->set_scans(1.2);
  EXPECT_THAT(Visible(Render(data)),
              HasSubstr("the lower bound (1.2) found, a plan for 70\u202f% needs at least 2 "
                        "scans."));
}

TEST(RenderReport, SaysWhyTheGoalWasMissed) {
  ReportData data = Plate();
  data.plan.mutable_coverage()->set_goal(0.975);
  data.plan.set_stop_reason(v1::Plan::STOP_REASON_MAX_TIME);
  EXPECT_THAT(Visible(Render(data)),
              HasSubstr("short of the goal of 97.5\u202f%: the time was up"));
}

TEST(RenderReport, EscapesAllTexts) {
  ReportData data = Plate();
  data.part_name = kHostileTemplateText;
  data.plan.set_inspection_name(kHostileTemplateText);
  data.plan.set_sightline_version(kHostileTemplateText);
  data.plan.set_strategy(kHostileTemplateText);
  data.plan.set_part_digest(kHostileTemplateText);
  data.plan.set_scene_digest(kHostileTemplateText);
  data.plan.mutable_bound()->set_scans(2);
  data.plan.mutable_bound()->set_statement(kHostileTemplateText);
  data.health.add_findings(kHostileTemplateText);
  data.notes = {kHostileTemplateText};
  data.timings = {{kHostileTemplateText, 1.0}};
  data.comparison = ComparisonTable{{0.9}, {{kHostileTemplateText, 5, {{9, 8, 10, 5}}}}};
  const std::string html = Render(data);
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(html,
              HasSubstr("&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;&amp;&quot;{{STYLE}}"));
  size_t count = 0;
  for (size_t at = html.find("&lt;script&gt;alert"); at != std::string::npos;
       at = html.find("&lt;script&gt;alert", at + 1)) {
    ++count;
  }
  EXPECT_GE(count, 11u);
}

TEST(RenderReport, LoadsNothingFromAnywhere) {
  const std::string html = Render(Plate());
  const std::regex attribute("(src|href|action|poster|data)=[\"']([^\"']{0,12})");
  // Markup only: the bundled script holds template strings of its own.
  const std::string markup = html.substr(0, html.find("<script>"));
  int found = 0;
  for (auto it = std::sregex_iterator(markup.begin(), markup.end(), attribute);
       it != std::sregex_iterator(); ++it) {
    EXPECT_EQ((*it)[2].str().substr(0, 5), "data:") << it->str();
    ++found;
  }
  EXPECT_GE(found, 4);  // icon and thumbnails
  EXPECT_THAT(markup, Not(HasSubstr("http://")));
  EXPECT_THAT(markup, Not(HasSubstr("https://")));
  EXPECT_THAT(markup, Not(HasSubstr("@import")));
  EXPECT_THAT(markup, Not(HasSubstr("url(")));
  // Even a mistake in the script could not load anything.
  EXPECT_THAT(markup, HasSubstr("default-src 'none'"));
}

TEST(RenderReport, EmbedsTheBundledViewer) {
  EXPECT_GT(ViewerScript().size(), 100000u);
  EXPECT_EQ(ViewerScript().find("</script"), absl::string_view::npos);
  EXPECT_THAT(Render(Plate()), HasSubstr(std::string(ViewerScript())));
}

TEST(RenderReport, ViewerDataHoldsMeshAndBits) {
  const ReportData data = Plate();
  const nlohmann::json json = ViewerData(Render(data));
  ASSERT_EQ(json["scans"].size(), 3u);
  std::string bits;
  ASSERT_TRUE(absl::Base64Unescape(json["scans"][1]["covered"].get<std::string>(), &bits));
  EXPECT_EQ(TargetBits::FromBytes(100, bits), data.scans[1].covered);
  // With the part's axes along the world's, the sensors move along -x as the stage goes forward.
  EXPECT_EQ(json["scans"][0]["sensor_direction"].get<std::vector<double>>(),
            (std::vector<double>{-1, 0, 0}));
  std::string nearest, positions;
  ASSERT_TRUE(absl::Base64Unescape(json["mesh"]["nearest_target"].get<std::string>(), &nearest));
  ASSERT_TRUE(absl::Base64Unescape(json["mesh"]["positions"].get<std::string>(), &positions));
  EXPECT_GT(nearest.size(), 4u * 100);
  EXPECT_EQ(nearest.size() / 4, positions.size() / 6);
}

TEST(RenderReport, ShowsHowFinelyScansMeasure) {
  ReportData data = Plate();
  EXPECT_THAT(Render(data), Not(HasSubstr("How finely each scan measures")));
  v1::ScanQuality& quality = *data.plan.mutable_scans(1)->mutable_quality();
  quality.mutable_depth_per_pixel_m()->set_median(0.000345);
  quality.mutable_depth_per_pixel_m()->set_high(0.00052);
  quality.set_overlap(0.125);
  data.depth_per_pixel_m.assign(data.targets.size(), 0.0004f);
  data.set_up_sheet = "set<up>.html";
  const std::string html = Render(data);
  EXPECT_EQ(MarkupFault("<html>" + QualitySection(data.plan) + "</html>"), "");
  EXPECT_THAT(html, AllOf(HasSubstr("How finely each scan measures"), HasSubstr("0.345"),
                          HasSubstr("0.520"), HasSubstr("measures nothing"),
                          HasSubstr("set&lt;up&gt;.html"), HasSubstr("depth_per_pixel")));
  data.depth_per_pixel_m.pop_back();
  EXPECT_THAT(std::string(RenderReport(data).status().message()),
              HasSubstr("depth_per_pixel_m has size 99, must be 100"));
}

TEST(RenderReport, SameDataSameBytes) { EXPECT_EQ(Render(Plate()), Render(Plate())); }

TEST(RenderReport, WorksWithoutScansAndPictures) {
  ReportData data = Plate();
  data.plan.clear_scans();
  data.scans.clear();
  data.plan.mutable_coverage()->set_coverage(0);
  EXPECT_THAT(Visible(Render(data)), HasSubstr("0 scans measure 0.0"));
}

TEST(RenderReport, RefusesDataThatDoNotFitTogether) {
  const auto message = [](const ReportData& data) {
    const auto html = RenderReport(data);
    EXPECT_EQ(html.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(html.status().message());
  };
  ReportData data = Plate();
  data.scans.pop_back();
  EXPECT_THAT(message(data), HasSubstr("scans has size 2, must be 3"));
  data = Plate();
  data.scans[1].covered = TargetBits(99);
  EXPECT_THAT(message(data), HasSubstr("scans[1].covered has size 99, must be 100"));
  data = Plate();
  data.measurable = TargetBits(1);
  EXPECT_THAT(message(data), HasSubstr("measurable has size 1"));
  data = Plate();
  data.plan.mutable_scans(2)->mutable_laser_pose()->add_matrix(0);
  EXPECT_THAT(message(data), HasSubstr("plan.scans[2].laser_pose.matrix has size 17, must be 16"));
  data = ExplainedPlate();
  data.reasons.pop_back();
  EXPECT_THAT(message(data), HasSubstr("reasons has size 99, must be 100"));
  data = Plate();
  data.mesh.triangles.clear();
  EXPECT_THAT(message(data), HasSubstr("mesh.triangles"));
}

TEST(CoverageCurveSvg, DrawsOneDotPerScanGoalAndBound) {
  const std::string svg = CoverageCurveSvg({{0.4, 0.7, 0.9}, 0.95, 2.5, true});
  size_t dots = 0;
  for (size_t at = svg.find("<circle"); at != std::string::npos; at = svg.find("<circle", at + 1))
    ++dots;
  EXPECT_EQ(dots, 3u);
  EXPECT_THAT(svg, HasSubstr("after scan 2: 70.00 % (+30.00)"));
  EXPECT_THAT(svg, HasSubstr("goal 95 %"));
  EXPECT_THAT(svg, HasSubstr("lower bound 2.5"));
  EXPECT_THAT(CoverageCurveSvg({{0.4}, 0, 0, false}), Not(HasSubstr("bound")));
}

TEST(Html, GroupsDigits) {
  EXPECT_EQ(GroupedInteger(0), "0");
  EXPECT_EQ(GroupedInteger(999), "999");
  EXPECT_EQ(GroupedInteger(20134), "20\u202f134");
  EXPECT_EQ(GroupedInteger(-1234567), "\u22121\u202f234\u202f567");
}

TEST(Html, JsonCannotEndTheScriptElement) {
  const std::string json = JsonForScript(nlohmann::json{{"a", "</script>"}}.dump());
  EXPECT_THAT(json, Not(HasSubstr("<")));
  EXPECT_EQ(nlohmann::json::parse(json)["a"], "</script>");
}

}  // namespace
}  // namespace sightline
