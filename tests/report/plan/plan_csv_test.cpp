// SPDX-License-Identifier: Apache-2.0
#include "report/plan/plan_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_split.h"

namespace sightline {
namespace {

v1::Plan TwoScans() {
  v1::Plan plan;
  plan.mutable_coverage()->set_measurable_targets(1000);
  for (int i = 0; i < 2; ++i) {
    v1::PlannedScan* scan = plan.add_scans();
    scan->set_index(i + 1);
    scan->set_locked(i == 1);
    v1::Measurement* m = scan->mutable_measurement();
    m->set_camera_distance_m(0.1 + 0.2);  // 0.30000000000000004
    m->set_triangulation_angle_deg(-12.5);
    m->set_offset_z_m(1e-7);
    scan->set_stage_start_m(-0.225);
    scan->set_stage_end_m(0.225);
    for (int frame = -225; frame <= 225; ++frame) scan->add_trigger_positions_m(frame * 1e-3);
    scan->set_cumulative_targets(400 + 300 * i);
  }
  return plan;
}

std::vector<std::vector<std::string>> Cells(const std::string& csv) {
  std::vector<std::vector<std::string>> rows;
  for (const auto line : absl::StrSplit(csv, '\n', absl::SkipEmpty())) {
    rows.push_back(absl::StrSplit(line, ','));
  }
  return rows;
}

std::string Cell(const std::vector<std::vector<std::string>>& rows, size_t row,
                 const std::string& column) {
  const auto& header = rows[0];
  const auto it = std::find(header.begin(), header.end(), column);
  EXPECT_NE(it, header.end()) << column;
  return it == header.end() ? "" : rows[row][it - header.begin()];
}

TEST(PlanCsv, OneRowPerScanAllAsWideAsTheHeader) {
  const auto rows = Cells(PlanCsv(TwoScans()));
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[1].size(), rows[0].size());
  EXPECT_EQ(rows[2].size(), rows[0].size());
  EXPECT_EQ(Cell(rows, 1, "scan"), "1");
  EXPECT_EQ(Cell(rows, 2, "scan"), "2");
  EXPECT_EQ(Cell(rows, 1, "locked"), "0");
  EXPECT_EQ(Cell(rows, 2, "locked"), "1");
  EXPECT_EQ(Cell(rows, 2, "frames_count"), "451");
  EXPECT_EQ(Cell(rows, 2, "cumulative_coverage_percent"), "70");
}

TEST(PlanCsv, EveryColumnNamesItsUnit) {
  const auto rows = Cells(PlanCsv(v1::Plan()));
  for (const std::string& name : rows[0]) {
    const bool has_unit = absl::EndsWith(name, "_m") || absl::EndsWith(name, "_mm") ||
                          absl::EndsWith(name, "_deg") || absl::EndsWith(name, "_s") ||
                          absl::EndsWith(name, "_count") || absl::EndsWith(name, "_percent");
    EXPECT_TRUE(has_unit || name == "scan" || name == "locked") << name;
  }
}

TEST(PlanCsv, QualityIsInMillimetresAndDegreesWhereItIsKnown) {
  v1::Plan plan = TwoScans();
  v1::ScanQuality& quality = *plan.mutable_scans(1)->mutable_quality();
  quality.mutable_depth_per_pixel_m()->set_median(0.00025);
  quality.mutable_triangulation_angle_deg()->set_median(31.5);
  quality.set_overlap(0.25);
  const auto rows = Cells(PlanCsv(plan));
  EXPECT_EQ(Cell(rows, 1, "depth_per_pixel_median_mm"), "");
  EXPECT_EQ(Cell(rows, 2, "depth_per_pixel_median_mm"), "0.25");
  EXPECT_EQ(Cell(rows, 2, "triangulation_angle_median_deg"), "31.5");
  EXPECT_EQ(Cell(rows, 2, "overlap_percent"), "25");
}

TEST(PlanCsv, NumbersReadBackExactly) {
  const auto rows = Cells(PlanCsv(TwoScans()));
  EXPECT_EQ(std::strtod(Cell(rows, 1, "camera_distance_m").c_str(), nullptr), 0.1 + 0.2);
  EXPECT_EQ(std::strtod(Cell(rows, 1, "offset_z_m").c_str(), nullptr), 1e-7);
  EXPECT_EQ(Cell(rows, 1, "triangulation_angle_deg"), "-12.5");
}

TEST(PlanCsv, PlanWithoutScansIsHeaderOnly) { EXPECT_EQ(Cells(PlanCsv(v1::Plan())).size(), 1u); }

}  // namespace
}  // namespace sightline
