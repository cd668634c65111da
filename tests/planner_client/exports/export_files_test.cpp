// SPDX-License-Identifier: Apache-2.0
#include "planner_client/exports/export_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/rig/scan_geometry.h"
#include "planner_client/exports/scan_frames.h"
#include "tests/integration/run_process.h"
#include "tests/planner_client/exports/sample_plan.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string ContentsOf(const v1::Plan& plan, const std::string& name) {
  const auto files = ExportPlan(plan);
  EXPECT_TRUE(files.ok()) << files.status();
  if (!files.ok()) return "";
  for (const ExportFile& file : *files) {
    if (file.name == name) return file.contents;
  }
  ADD_FAILURE() << "no " << name;
  return "";
}

// Camera and laser are where the rig's geometry has them, wherever the part is in the CAD file.
TEST(FramesOfScan, AreThoseOfTheRig) {
  const v1::Plan plan = SamplePlan();
  for (const v1::PlannedScan& scan : plan.scans()) {
    const ScanGeometry geometry =
        MakeScanGeometry(SampleRig(), MeasurementFromProto(scan.measurement()));
    const auto frames = FramesOfScan(scan);
    ASSERT_TRUE(frames.ok()) << frames.status();
    EXPECT_TRUE(frames->camera.matrix().isApprox(geometry.camera.Matrix(), 1e-9));
    EXPECT_TRUE(frames->laser.matrix().isApprox(geometry.laser.Matrix(), 1e-9));
    const Eigen::Vector3d place_m(0.1, 0.2, -0.3);
    EXPECT_LT(
        (frames->PartAt(0.07) * place_m - PartToWorld(geometry, kSampleCentre_m, place_m, 0.07))
            .norm(),
        1e-9);
  }
}

TEST(FramesOfScan, RefusesWhatIsNoPose) {
  v1::PlannedScan scan = SamplePlan().scans(1);
  scan.mutable_laser_pose()->set_matrix(0, 2);
  EXPECT_THAT(std::string(FramesOfScan(scan).status().message()),
              HasSubstr("scan 2: laser_pose.matrix is no rotation"));
  scan = SamplePlan().scans(1);
  scan.mutable_camera_pose()->clear_matrix();
  EXPECT_THAT(std::string(FramesOfScan(scan).status().message()),
              HasSubstr("scan 2: camera_pose.matrix must have 16 numbers"));
  v1::Plan plan = SamplePlan();
  *plan.mutable_scans(0) = scan;
  EXPECT_EQ(ExportPlan(plan).status().code(), absl::StatusCode::kInvalidArgument);
}

// Every file by parsers of its own: Python's csv and json, and YAML 1.1 as ROS reads it; poses by
// formulas that are not ours.
TEST(ExportPlan, IsReadBackByOthers) {
  std::string folder = "/tmp/sightline-exports-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  fs::create_directories(folder + "/exports");
  const v1::Plan plan = SamplePlan();
  const auto files = ExportPlan(plan);
  ASSERT_TRUE(files.ok()) << files.status();
  for (const ExportFile& file : *files) {
    std::ofstream(folder + "/exports/" + file.name) << file.contents;
  }
  std::ofstream(folder + "/plan.json") << ToJson(plan);
  const ProcessResult result = RunProcess(
      absl::StrCat("/usr/bin/python3 -B ", SIGHTLINE_READ_EXPORTS, " ", folder, " 0.55"));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("3 scans agree"));
  fs::remove_all(folder);
}

TEST(ExportPlan, StagePositionsAreRoundMillimetres) {
  EXPECT_THAT(ContentsOf(SamplePlan(), "triggers.csv"), HasSubstr("\n1,0,-55.5\n1,1,-55\n"));
  EXPECT_THAT(ContentsOf(SamplePlan(), "scans.csv"), HasSubstr("\n1,-55.5,47.5,207,0.5,"));
}

TEST(ExportPlan, PlanWithoutScansIsReadable) {
  EXPECT_THAT(ContentsOf({}, "camera_poses.yaml"), HasSubstr("poses: []"));
  EXPECT_EQ(nlohmann::json::parse(ContentsOf({}, "poses.json"))["scans"].size(), 0u);
  EXPECT_EQ(ContentsOf({}, "triggers.csv"), "scan,frame,stage_position_mm\n");
}

TEST(ExportPlan, SamePlanSameBytes) {
  for (const char* name : {"scans.csv", "poses.json", "camera_poses.yaml", "transforms.yaml"}) {
    EXPECT_EQ(ContentsOf(SamplePlan(), name), ContentsOf(SamplePlan(), name));
  }
}

}  // namespace
}  // namespace sightline
