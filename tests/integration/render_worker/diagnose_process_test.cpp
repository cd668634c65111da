// SPDX-License-Identifier: Apache-2.0
// `sightline diagnose` and `sightline verify` as processes, with the worker they start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/verification.pb.h"
#include "tests/integration/run_process.h"
#include "tests/render_worker/scene_diagnosis/groove_scene.h"
#include "tests/render_worker/service/plate_spec.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class DiagnoseProcessTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_NE(mkdtemp(folder_.data()), nullptr); }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(folder_ + "/" + name).parent_path());
    std::ofstream(folder_ + "/" + name) << text;
    return folder_ + "/" + name;
  }

  // `sightline ARGUMENTS`; {folder} is replaced.
  ProcessResult Run(const std::string& arguments) const {
    const std::string command = absl::StrCat(
        BinFolder(), "/sightline ", absl::StrReplaceAll(arguments, {{"{folder}", folder_}}));
    return RunProcess(command);
  }

  std::string folder_ = "/tmp/sightline-diagnose-process-XXXXXX";
};

// A groove rendered with light from flank to flank, compared with the model without; then rendered
// again as it was found.
TEST_F(DiagnoseProcessTest, PartFromImagesToACalibratedInspection) {
  Write("groove.obj", kGrooveObj);
  Write("inspection.json", absl::StrReplaceAll(GrooveInspectionJson(R"(, "name": "groove")"),
                                               {{R"("laser_interreflection": false)",
                                                 R"("laser_interreflection": true)"}}));
  Write("plan.json", R"({"scans": [{"index": 1, "measurement": {"camera_distance_m": 0.3,
    "triangulation_angle_deg": 30}, "trigger_positions_m": [0, 0.001]}]})");
  ProcessResult result =
      Run("render {folder}/inspection.json --plan {folder}/plan.json --out {folder}/set");
  ASSERT_EQ(result.exit_code, 0) << result.output;

  result = Run("diagnose {folder}/set --part-unit m");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("set/groove.obj: cannot be read"));
  result = Run("diagnose {folder}/set --part {folder}/groove.obj --part-unit inch");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("another file or another unit"));

  result = Run("diagnose {folder}/set --part {folder}/groove.obj --part-unit m --out {folder}/d");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  v1::Diagnosis full;
  ASSERT_TRUE(ReadStrictJsonFile(folder_ + "/d/diagnosis_full.json", &full).ok());
  EXPECT_EQ(full.ranked(0).effect(), "illumination.interreflection") << full.finding();
  EXPECT_LT(full.held_out_improvement().with_effect(), 0.7 * full.held_out_improvement().null());
  for (const char* file : {"diagnosis.json", "groove.json", "report.html", "report.json"}) {
    EXPECT_TRUE(fs::exists(folder_ + "/d/" + file)) << file;
  }
  const std::string calibrated = folder_ + "/d/calibrated/inspection.json";
  const auto inspection = ReadInspection(calibrated);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_TRUE(inspection->render.laser_interreflection);
  result = Run("render " + calibrated + " --plan {folder}/plan.json --out {folder}/again");
  EXPECT_EQ(result.exit_code, 0) << result.output;

  // With all that light in the model nothing is missing.
  result = Run("diagnose {folder}/set --inspection " + calibrated + " --out {folder}/d2");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  full.Clear();
  ASSERT_TRUE(ReadStrictJsonFile(folder_ + "/d2/diagnosis_full.json", &full).ok());
  EXPECT_EQ(full.verdict(), "none") << full.finding();
}

TEST_F(DiagnoseProcessTest, PlateIsVerifiedAndTooFewRecordingsAreSaid) {
  Write("shots.json", ToJson(PlateSpec(4).plate().recordings()));
  ProcessResult result = Run("render {folder}/shots.json --out {folder}/set");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  result = Run("verify {folder}/set");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  v1::Verification verification;
  ASSERT_TRUE(
      ReadStrictJsonFile(folder_ + "/set/verification/verification.json", &verification).ok());
  EXPECT_EQ(verification.recordings_size(), 3);  // with the laser on
  EXPECT_TRUE(fs::exists(folder_ + "/set/verification/report.html"));

  result = Run("diagnose {folder}/set");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("plate positions"));

  fs::remove(folder_ + "/set/images/1.png");
  for (const char* command : {"diagnose", "verify"}) {
    result = Run(absl::StrCat(command, " {folder}/set"));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.output, HasSubstr("1 of 4 images cannot be read: images/1.png"));
  }
}

}  // namespace
}  // namespace sightline
