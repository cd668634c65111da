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
#include "planner_client/report/plan/quality_section.h"
#include "tests/planner_client_report/well_formed.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostile[] = "<script>alert('x')</script>&\"{{STYLE}}";

// A square plate of 10 x 10 targets. Scan k of 3 measures every target whose index is k modulo 3 in
// the first eight columns; nothing measures the last two. Targets 0 and 1 are not measurable.
ReportData Plate() {
  ReportData data;
  data.mesh.positions_m = {{0, 0, 0}, {0.05f, 0, 0}, {0.05f, 0.05f, 0}, {0, 0.05f, 0}};
  data.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (int i = 0; i < 100; ++i) {
    data.targets.positions_m.push_back({0.005f * (i % 10), 0.005f * (i / 10), 0});
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

TEST(RenderReport, FindingNamesBoundOnlyWhenConverged) {
  ReportData data = Plate();
  data.plan.mutable_bound()->set_scans(2.2);
  EXPECT_THAT(Visible(Render(data)), HasSubstr("not proven to be a bound"));
  EXPECT_THAT(Visible(Render(data)), Not(HasSubstr("lower bound")));
  data.plan.mutable_bound()->set_converged(true);
  EXPECT_THAT(Visible(Render(data)),
              HasSubstr("No plan for 70\u202f% can do with fewer (lower bound 2.2)"));
  data.plan.mutable_bound()->set_scans(1.2);
  EXPECT_THAT(Visible(Render(data)),
              HasSubstr("A plan for 70\u202f% needs at least 2 (lower bound 1.2)"));
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
  data.part_name = kHostile;
  data.plan.set_inspection_name(kHostile);
  data.plan.set_sightline_version(kHostile);
  data.plan.set_strategy(kHostile);
  data.plan.set_part_digest(kHostile);
  data.plan.set_scene_digest(kHostile);
  data.plan.mutable_bound()->set_scans(2);
  data.plan.mutable_bound()->set_statement(kHostile);
  data.health.add_findings(kHostile);
  data.notes = {kHostile};
  data.timings = {{kHostile, 1.0}};
  data.comparison = ComparisonTable{{0.9}, {{kHostile, 5, {{9, 8, 10, 5}}}}};
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
  EXPECT_EQ(MarkupFault(QualitySection(data.plan)), "");
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
