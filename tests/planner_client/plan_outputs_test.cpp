// SPDX-License-Identifier: Apache-2.0
// A plan is written whatever the coverage server does not give for its report.
#include "planner_client/commands/planning/plan_outputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

// Targets every centimetre of a line from y = -0.1 m to 0.1 m.
constexpr size_t kTargets = 21;

struct Refusals {
  bool pictures = false;
  bool points = false;
  bool explanations = false;
};

// A scan at offset y covers the targets within 3 cm of it. What is refused has the status given.
class RefusingClient final : public CoverageClient {
 public:
  RefusingClient(Refusals refusals, absl::Status refusal)
      : refusals_(refusals), refusal_(std::move(refusal)) {
    for (size_t t = 0; t < kTargets; ++t) {
      targets_.positions_m.emplace_back(0.0f, 0.01f * static_cast<float>(t) - 0.1f, 0.0f);
      targets_.normals.emplace_back(0.0f, 0.0f, 1.0f);
      targets_.regions.push_back(-1);
    }
    scene_.scene_digest = "scene";
    scene_.target_count = kTargets;
    scene_.measurable_count = kTargets;
    scene_.measurable_in_free_space_count = kTargets;
    scene_.part_centre_m = Eigen::Vector3d::Zero();
    scene_.part_size_m = {0.1, 0.2, 0};
  }

  const SceneInfo& scene() const override { return scene_; }
  const TargetSet& targets() const override { return targets_; }
  const TargetBits& measurable() const override { return gain_model_.measurable(); }
  int64_t evaluations() const override { return gain_model_.evaluations(); }
  int recoveries() const override { return 0; }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    return gain_model_.Gains(measurements, known);
  }
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override {
    return gain_model_.WeightedGains(measurements, weights);
  }
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    return gain_model_.FastCoverage(measurements);
  }
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    return gain_model_.ExactCoverage(measurements);
  }
  absl::StatusOr<std::vector<ScanCoverage>> DisplacedCoverage(
      std::span<const Measurement> measurements, std::span<const ScanDisplacement>) override {
    return gain_model_.ExactCoverage(measurements);
  }
  absl::StatusOr<std::vector<ScanPoint>> MeasurementPoints(const Measurement&) override {
    if (refusals_.points) return refusal_;
    return std::vector<ScanPoint>{{{0, 0, 0}, {0, 0, 1}, 3, 200},
                                  {{0, 0.01f, 0}, {0, 0, 1}, 4, 201}};
  }
  absl::StatusOr<std::vector<ScanGain>> UncertaintyGains(std::span<const Measurement>,
                                                         const UncertaintyQuery&,
                                                         std::span<const float>,
                                                         std::span<const float>) override {
    return absl::UnimplementedError("no uncertainty");
  }
  absl::StatusOr<std::vector<InformedScan>> FastInformation(std::span<const Measurement>) override {
    return absl::UnimplementedError("no uncertainty");
  }
  absl::StatusOr<PosteriorUncertainties> Uncertainties(std::span<const Measurement>,
                                                       std::span<const uint32_t>, bool,
                                                       std::span<const float>) override {
    return absl::UnimplementedError("no uncertainty");
  }
  absl::StatusOr<std::vector<TargetReason>> ExplainTargets(
      std::span<const uint32_t> targets) override {
    if (refusals_.explanations) return refusal_;
    return std::vector<TargetReason>(targets.size(), {v1::UNCOVERED_REASON_NOT_CHOSEN, -1});
  }
  absl::StatusOr<std::string> RenderView(v1::RenderViewRequest) override {
    if (refusals_.pictures) return refusal_;
    return std::string("\x89PNG bytes");
  }

 private:
  const Refusals refusals_;
  const absl::Status refusal_;
  FunctionGainModel gain_model_{
      kTargets, [](const Measurement& m, size_t t) {
        return std::abs(0.01 * static_cast<double>(t) - 0.1 - m.offset_y_m) < 0.0301;
      }};
  TargetSet targets_;
  SceneInfo scene_;
};

class PlanOutputsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    output_.folder = folder_ + "/plan";
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Makes the plan of two scans and writes it; what is said on stderr.
  std::string Write(Refusals refusals,
                    const absl::Status& refusal = absl::UnavailableError("the renderer is gone")) {
    session_ = {};
    session_.inspection.name = "line";
    session_.inspection.part_file = "parts/plate.stl";
    session_.inspection.domain = ThesisDomain();
    session_.inspection.rig.lens = Lens{};
    auto mesh = std::make_shared<TriangleMesh>();
    mesh->positions_m = {
        {-0.05f, -0.1f, 0}, {0.05f, -0.1f, 0}, {0.05f, 0.1f, 0}, {-0.05f, 0.1f, 0}};
    mesh->triangles = {{0, 1, 2}, {0, 2, 3}};
    session_.part = mesh;
    session_.part_digest = PartDigestOf(*mesh);
    session_.client = std::make_unique<RefusingClient>(refusals, refusal);
    std::vector<ChosenScan> scans(2);
    for (size_t i = 0; i < scans.size(); ++i) {
      Measurement& m = scans[i].measurement;
      m.camera_distance_m = 0.4;
      m.triangulation_angle_rad = 0.5;
      m.offset_y_m = i == 0 ? -0.05 : 0.05;
      scans[i].exact = session_.client->ExactCoverage({&m, 1})->front();
      scans[i].fast_covered = scans[i].exact.covered.Count();
    }
    testing::internal::CaptureStderr();
    auto document = MakePlanDocument(session_, std::move(scans), {"test", 1, 10});
    EXPECT_TRUE(document.ok()) << document.status();
    if (!document.ok()) return testing::internal::GetCapturedStderr();
    document_ = *std::move(document);
    written_ = WritePlanOutputs(session_, document_, output_);
    return testing::internal::GetCapturedStderr();
  }

  std::string Bytes(const std::string& file) const {
    std::ostringstream bytes;
    bytes << std::ifstream(output_.folder + "/" + file, std::ios::binary).rdbuf();
    return bytes.str();
  }
  bool Exists(const std::string& file) const { return fs::exists(output_.folder + "/" + file); }

  // The plan itself, and all that needs nothing more from the server.
  void ExpectWholePlan() const {
    EXPECT_TRUE(written_.ok()) << written_;
    v1::Plan plan;
    const absl::Status read = ReadStrictJsonFile(output_.folder + "/plan.json", &plan);
    ASSERT_TRUE(read.ok()) << read;
    ASSERT_EQ(plan.scans_size(), 2);
    EXPECT_EQ(plan.coverage().covered_targets(), 14);
    for (const v1::PlannedScan& scan : plan.scans())
      EXPECT_EQ(scan.camera_pose().matrix_size(), 16);
    for (const char* file : {"plan.csv", "setup.html", "report.html", "exports"}) {
      EXPECT_TRUE(Exists(file)) << file;
    }
  }

  std::string folder_ = "/tmp/sightline-plan-outputs-XXXXXX";
  OutputOptions output_;
  PlanningSession session_;
  PlanDocument document_;
  absl::Status written_;
};

TEST_F(PlanOutputsTest, NothingIsMissingOfAWillingServer) {
  const std::string said = Write({});
  ExpectWholePlan();
  EXPECT_THAT(document_.missing, IsEmpty());
  EXPECT_THAT(said, Not(HasSubstr("missing")));
  EXPECT_TRUE(Exists("points/scan_01.ply"));
  EXPECT_TRUE(Exists("points/scan_02.ply"));
}

TEST_F(PlanOutputsTest, APlanIsKeptWhenEverythingElseIsRefused) {
  for (const absl::Status& refusal :
       {absl::UnavailableError("the renderer is gone"), absl::InternalError("a fault"),
        absl::DeadlineExceededError("too late"), absl::ResourceExhaustedError("no memory")}) {
    const std::string said =
        Write({.pictures = true, .points = true, .explanations = true}, refusal);
    ExpectWholePlan();
    const std::string why = absl::StrCat(": ", refusal.message());
    // Each thing once, with the server's reason.
    std::vector<std::string> expected = {"missing: reasons why targets are not covered" + why,
                                         "missing: picture of what is measurable" + why,
                                         "missing: picture of what is measured" + why};
    for (const char* scan : {"1", "2"}) {
      for (const char* what : {"quality", "picture", "points"}) {
        expected.push_back(absl::StrCat("missing: ", what, " of scan ", scan, why));
      }
    }
    EXPECT_THAT(document_.missing, ::testing::UnorderedElementsAreArray(expected));
    const std::string report = Bytes("report.html");
    for (const std::string& missing : document_.missing) {
      EXPECT_THAT(said, HasSubstr(absl::StrCat("warning: ", missing, "\n")));
      EXPECT_THAT(report, HasSubstr(missing));
    }
    EXPECT_FALSE(Exists("points/scan_01.ply"));
  }
}

// One refusal takes nothing else with it.
TEST_F(PlanOutputsTest, OnlyWhatWasRefusedIsMissing) {
  Write({.pictures = true});
  ExpectWholePlan();
  EXPECT_THAT(document_.missing, AllOf(SizeIs(4), ::testing::Each(HasSubstr("picture of"))));
  EXPECT_TRUE(Exists("points/scan_02.ply"));
  EXPECT_FALSE(document_.reasons.empty());

  Write({.explanations = true});
  ExpectWholePlan();
  EXPECT_THAT(document_.missing, AllOf(SizeIs(1), Contains(HasSubstr("reasons why"))));
  EXPECT_TRUE(document_.reasons.empty());
  EXPECT_TRUE(Exists("points/scan_01.ply"));

  Write({.points = true});
  ExpectWholePlan();
  EXPECT_THAT(document_.missing, SizeIs(4));
  EXPECT_THAT(document_.missing, Contains(HasSubstr("points of scan 2")));
  EXPECT_THAT(document_.missing, Contains(HasSubstr("quality of scan 2")));
}

// Errors of writing are no refusals: they are said.
TEST_F(PlanOutputsTest, AFolderThatCannotBeWrittenIsAnError) {
  std::ofstream(folder_ + "/file") << "in the way";
  output_.folder = folder_ + "/file/plan";
  Write({});
  EXPECT_FALSE(written_.ok());
}

}  // namespace
}  // namespace sightline
