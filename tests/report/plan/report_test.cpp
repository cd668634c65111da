// SPDX-License-Identifier: Apache-2.0
#include "report/plan/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "report/document/report_page.h"
#include "report/page/assets.h"
#include "report/page/html.h"
#include "tests/report/report_reading.h"
#include "tests/report/unpacked_numbers.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostileText[] = "<script>alert('x')</script>&\"{{STYLE}}";

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

v1::Report Made(const ReportData& data) {
  const auto report = PlanReport(data);
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  EXPECT_EQ(ReportFault(*report), "");
  return *report;
}

v1::ReportScene SceneOf(const v1::Report& report) {
  return SectionOf(report, "view").sections(0).blocks(0).scene();
}

TEST(PlanReport, ShowsEveryScanWithParametersInMillimetresAndDegrees) {
  const v1::Report report = Made(Plate());
  const v1::ReportTable table = FirstTableOf(report, "scans");
  ASSERT_EQ(table.rows_size(), 3);
  for (int k = 0; k < 3; ++k) {
    const std::string scan = absl::StrCat(k + 1);
    EXPECT_EQ(table.rows(k).view().scan(), k);
    EXPECT_EQ(CellOf(table, scan, "distance").text(), absl::StrCat(311 + 100 * k, ".7"));
    EXPECT_DOUBLE_EQ(CellOf(table, scan, "distance").number(), 1e3 * (0.3117 + 0.1 * k));
    EXPECT_EQ(CellOf(table, scan, "\u03c4").text(), absl::StrCat("\u2212", 10 + k, ".25"));
    EXPECT_EQ(table.rows(k).cells(1).picture().png(), "not really a PNG");
  }
  EXPECT_EQ(CellOf(table, "1", "start").text(), "\u221211");
  EXPECT_EQ(CellOf(table, "1", "end").text(), "44");
  EXPECT_THAT(FindingOf(report), HasSubstr("3 scans measure 79.6\u202f%"));
}

TEST(PlanReport, DrawsCoverageWithGoalAndBound) {
  ReportData data = Plate();
  data.plan.mutable_bound()->set_scans(2.5);
  const v1::ReportChart chart = ChartsOf(SectionOf(Made(data), "curve")).at(0);
  const v1::ReportSeries& measured = chart.series(chart.series_size() - 1);
  EXPECT_TRUE(measured.of_scans());
  ASSERT_EQ(measured.x_size(), 3);
  EXPECT_NEAR(measured.y(2), 100 * data.plan.coverage().coverage(), 1e-9);
  ASSERT_EQ(chart.lines_size(), 2);
  EXPECT_EQ(chart.lines(0).name(), "goal 70\u202f%");
  EXPECT_EQ(chart.lines(1).at(), 2.5);
  EXPECT_THAT(chart.lines(1).name(), HasSubstr("not a proven bound"));
}

TEST(PlanReport, ListsUncoveredTargets) {
  const v1::Report report = SectionOf(Made(Plate()), "uncovered");
  EXPECT_THAT(TextOf(report), AllOf(HasSubstr("20 measurable targets in 1 connected region are not "
                                              "measured"),
                                    HasSubstr("5 \u00d7 45 \u00d7 0"), HasSubstr("facing z+")));
  const v1::ReportRow row = FirstTableOf(report, "uncovered").rows(0);
  EXPECT_TRUE(row.view().has_unmeasured_region());
  EXPECT_EQ(row.view().unmeasured_region(), 0);
}

// The plate with reasons: 5 of the 20 uncovered targets were not chosen, a clamp hides the others;
// the two that are not measurable are hidden by the part.
ReportData ExplainedPlate() {
  ReportData data = Plate();
  auto clamp = std::make_shared<TriangleMesh>();
  clamp->positions_m = {{0, 0, 0.1f}, {0.05f, 0, 0.1f}, {0, 0.05f, 0.1f}};
  clamp->triangles = {{0, 1, 2}};
  data.obstacles = {{kHostileText, v1::Obstacle::FRAME_PART, clamp},
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
  add(v1::UNCOVERED_REASON_OBSTACLE, kHostileText, 15, true, coverage.mutable_uncovered());
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

TEST(PlanReport, SaysWhyPlacesAreNotMeasured) {
  const v1::Report report = Made(ExplainedPlate());
  const v1::ReportTable table = FirstTableOf(report, "reasons");
  const auto row = [&](const std::string& name) {
    std::vector<std::string> texts;
    for (const char* column : {"targets", "of all", "counted as measurable", "not measurable"}) {
      texts.push_back(CellOf(table, name, column).text());
    }
    return texts;
  };
  EXPECT_THAT(row("hidden by the part itself"), ElementsAre("2", "2.0\u202f%", "0", "2"));
  EXPECT_THAT(row("not measured, in all"), ElementsAre("22", "22.0\u202f%", "20", "2"));
  EXPECT_EQ(table.rows(0).cells(0).reason(), v1::UNCOVERED_REASON_OBSTACLE);
  // The unmeasured region and what is not measurable.
  EXPECT_THAT(TextOf(report),
              AllOf(HasSubstr("not chosen: other scans would measure it (5)"),
                    HasSubstr("The other 2 count neither for a scan nor against it: hidden by the "
                              "part itself (2).")));
  const v1::ReportTable regions = TablesOf(SectionOf(report, "reasons")).at(1);
  EXPECT_EQ(CellOf(regions, "flange", "of its targets").text(), "77.8\u202f%");

  const v1::ReportScene scene = SceneOf(report);
  ASSERT_EQ(scene.reasons().kinds_size(), 3);
  EXPECT_EQ(scene.reasons().kinds(0).targets(), 15);
  const std::vector<uint8_t> kinds = UnpackNumbers<uint8_t>(scene.reasons().of_target());
  ASSERT_EQ(kinds.size(), 100U);
  EXPECT_EQ(kinds[0], 3);
  EXPECT_EQ(kinds[2], 0);
  EXPECT_EQ(kinds[8], 2);
  EXPECT_EQ(kinds[99], 1);
  ASSERT_EQ(scene.regions_of_interest_size(), 1);
  EXPECT_EQ(scene.regions_of_interest(0).name(), "flange");
}

TEST(PlanReport, DrawsObstaclesWhereTheyAreInEveryScan) {
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
  const v1::ReportScene scene = SceneOf(Made(data));
  ASSERT_EQ(scene.obstacles_size(), 4);
  EXPECT_TRUE(scene.obstacles(0).turns_with_part());
  EXPECT_TRUE(scene.obstacles(0).poses().empty());
  EXPECT_EQ(scene.obstacles(1).name(), "table");
  const auto origin = [&](int obstacle) {
    const auto& poses = scene.obstacles(obstacle).poses();
    return std::vector<double>{poses[16 + 3], poses[16 + 7], poses[16 + 11]};
  };
  // World to part: x_part = y_world - 0.25, y_part = 0.5 - x_world, z_part = z_world - 0.125.
  EXPECT_EQ(origin(1), (std::vector<double>{0.02 - 0.25, 0.5, -0.04 - 0.125}));
  EXPECT_EQ(origin(2), (std::vector<double>{0.02 - 0.25, 0.5, 0.03 - 0.125}));
  EXPECT_EQ(origin(3), (std::vector<double>{-0.25, 0.5 - 0.011, -0.125}));  // starts at -11 mm
  EXPECT_TRUE(scene.obstacles(3).stands_still());
}

TEST(PlanReport, FindingNamesBoundOnlyWhenConverged) {
  ReportData data = Plate();
  data.plan.mutable_bound()->set_scans(2.2);
  EXPECT_THAT(FindingOf(Made(data)), HasSubstr("not proven to be a bound"));
  EXPECT_THAT(FindingOf(Made(data)), Not(HasSubstr("lower bound")));
  data.plan.mutable_bound()->set_converged(true);
  EXPECT_THAT(FindingOf(Made(data)),
              HasSubstr("the lower bound (2.2) found, a plan for 70\u202f% needs at least 3 scans: "
                        "no fewer than this one."));
  data.plan.mutable_bound()->set_scans(1.2);
  EXPECT_THAT(FindingOf(Made(data)),
              HasSubstr("the lower bound (1.2) found, a plan for 70\u202f% needs at least 2 "
                        "scans."));
}

TEST(PlanReport, SaysWhyTheGoalWasMissed) {
  ReportData data = Plate();
  data.plan.mutable_coverage()->set_goal(0.975);
  data.plan.set_stop_reason(v1::Plan::STOP_REASON_MAX_TIME);
  EXPECT_THAT(FindingOf(Made(data)),
              HasSubstr("short of the goal of 97.5\u202f%: the time was up"));
}

TEST(PlanReport, SceneHoldsMeshAndBits) {
  const ReportData data = Plate();
  const v1::ReportScene scene = SceneOf(Made(data));
  ASSERT_EQ(scene.scans_size(), 3);
  EXPECT_EQ(TargetBits::FromBytes(100, UnpackBytes(scene.scans(1).covered())),
            data.scans[1].covered);
  // With the part's axes along the world's, the sensors move along -x as the stage goes forward.
  EXPECT_THAT(scene.scans(0).sensor_direction(), ElementsAre(-1, 0, 0));
  const auto nearest = UnpackNumbers<uint32_t>(scene.mesh().nearest_target());
  const auto positions = UnpackNumbers<uint16_t>(scene.mesh().positions(), 3);
  const auto triangles = UnpackNumbers<uint32_t>(scene.mesh().triangles(), 3);
  EXPECT_GT(nearest.size(), 100U);
  EXPECT_EQ(3 * nearest.size(), positions.size());
  EXPECT_EQ(UnpackNumbers<uint8_t>(scene.mesh().normals(), 3).size(), positions.size());
  // All vertices lie in the plate, and triangles cover it.
  double area_m2 = 0;
  const auto vertex = [&](uint32_t v) {
    Eigen::Vector3d place_m;
    for (int axis = 0; axis < 3; ++axis) {
      place_m[axis] = scene.origin_m(axis) + scene.quantum_m() * positions.at(3 * v + axis);
    }
    return place_m;
  };
  for (size_t t = 0; t + 2 < triangles.size(); t += 3) {
    const Eigen::Vector3d a = vertex(triangles[t]);
    area_m2 += 0.5 * (vertex(triangles[t + 1]) - a).cross(vertex(triangles[t + 2]) - a).z();
  }
  EXPECT_NEAR(area_m2, 0.05 * 0.05, 1e-6);
  // The target nearest to a vertex is at most half a diagonal of the targets' grid away.
  const auto targets = UnpackNumbers<uint16_t>(scene.targets().positions(), 3);
  for (uint32_t v = 0; v < nearest.size(); ++v) {
    Eigen::Vector3d away = vertex(v);
    for (int axis = 0; axis < 3; ++axis) {
      away[axis] -= scene.origin_m(axis) + scene.quantum_m() * targets.at(3 * nearest[v] + axis);
    }
    EXPECT_LT(away.norm(), 0.0072) << v;
  }
}

TEST(PlanReport, ThePageHasTheViewerAndLoadsNothing) {
  const std::string page = ReportPage(Made(Plate()), "report.json");
  EXPECT_GT(SceneScript().size(), 100000U);
  EXPECT_EQ(SceneScript().find("</script"), absl::string_view::npos);
  EXPECT_THAT(page, HasSubstr(std::string(SceneScript())));
  const std::string markup = page.substr(0, page.find("<script"));
  EXPECT_THAT(markup,
              AllOf(HasSubstr("default-src 'none'"), Not(HasSubstr("http://")),
                    Not(HasSubstr("https://")), Not(HasSubstr("@import")), Not(HasSubstr("url("))));
}

TEST(PlanReport, TextsAreTakenAsTheyAre) {
  ReportData data = Plate();
  const std::string hostile = "<script>alert('x')</script>&\"";
  data.part_name = hostile;
  data.plan.set_inspection_name(hostile);
  data.plan.set_strategy(hostile);
  data.health.add_findings(hostile);
  data.notes = {hostile};
  data.timings = {{hostile, 1.0}};
  data.comparison = ComparisonTable{{0.9}, {{hostile, 5, {{9, 8, 10, 5}}}}};
  const v1::Report report = Made(data);
  EXPECT_EQ(report.heading(), hostile);
  EXPECT_EQ(FirstTableOf(report, "comparison").rows(0).cells(0).text(), hostile);
  EXPECT_THAT(ReportPage(report, "report.json"), Not(HasSubstr("<script>alert")));
}

TEST(PlanReport, ShowsHowFinelyScansMeasure) {
  ReportData data = Plate();
  EXPECT_EQ(SectionOf(Made(data), "quality").sections_size(), 0);
  v1::ScanQuality& quality = *data.plan.mutable_scans(1)->mutable_quality();
  quality.mutable_depth_per_pixel_m()->set_median(0.000345);
  quality.mutable_depth_per_pixel_m()->set_high(0.00052);
  quality.set_overlap(0.125);
  data.depth_per_pixel_m.assign(data.targets.size(), 0.0004F);
  data.set_up_sheet = "setup.html";
  const v1::Report report = Made(data);
  const v1::ReportTable table = FirstTableOf(report, "quality");
  EXPECT_EQ(CellOf(table, "1", "pixel on the part").text(), "measures nothing");
  EXPECT_EQ(CellOf(table, "2", "depth per pixel").text(), "0.345");
  EXPECT_THAT(CellOf(table, "2", "depth per pixel").detail(), HasSubstr("0.520"));
  EXPECT_NEAR(CellOf(table, "2", "overlap").number(), 12.5, 1e-12);
  EXPECT_EQ(UnpackNumbers<uint16_t>(SceneOf(report).depth_per_pixel().codes()).size(), 100U);
  data.depth_per_pixel_m.pop_back();
  EXPECT_THAT(std::string(PlanReport(data).status().message()),
              HasSubstr("depth_per_pixel_m has size 99, must be 100"));
}

TEST(PlanReport, SameDataSameBytes) { EXPECT_EQ(ToJson(Made(Plate())), ToJson(Made(Plate()))); }

TEST(PlanReport, WorksWithoutScansAndPictures) {
  ReportData data = Plate();
  data.plan.clear_scans();
  data.scans.clear();
  data.plan.mutable_coverage()->set_coverage(0);
  EXPECT_THAT(FindingOf(Made(data)), HasSubstr("0 scans measure 0.0"));
}

TEST(PlanReport, RefusesDataThatDoNotFitTogether) {
  const auto message = [](const ReportData& data) {
    const auto report = PlanReport(data);
    EXPECT_EQ(report.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(report.status().message());
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

TEST(Html, GroupsDigits) {
  EXPECT_EQ(GroupedInteger(0), "0");
  EXPECT_EQ(GroupedInteger(999), "999");
  EXPECT_EQ(GroupedInteger(20134), "20\u202f134");
  EXPECT_EQ(GroupedInteger(-1234567), "\u22121\u202f234\u202f567");
}

TEST(Html, CompactJsonKeepsTexts) {
  const nlohmann::json json = {{"a b", "c \\\" \n d "}, {"list", {1, 2, "}  {"}}};
  const std::string compact = CompactJson(json.dump(2));
  EXPECT_EQ(compact, json.dump());
}

TEST(Html, JsonCannotEndTheScriptElement) {
  const std::string json = JsonForScript(nlohmann::json{{"a", "</script>"}}.dump());
  EXPECT_THAT(json, Not(HasSubstr("<")));
  EXPECT_EQ(nlohmann::json::parse(json)["a"], "</script>");
}

}  // namespace
}  // namespace sightline
