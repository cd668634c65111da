// SPDX-License-Identifier: Apache-2.0
// Inputs of the command `sightline`: plans, fronts, journals, robots, requests of its page.
#include <memory>
#include <vector>

#include "core/inspection/robot_mount.h"
#include "planner_client/explore/explore_request.h"
#include "planner_client/gain_model/record_replay_gain_model.h"
#include "planner_client/optics_client/uncertainty_correction.h"
#include "planner_client/render_client/finished_images.h"
#include "planning/pareto/pareto_json.h"
#include "planning/robot/urdf/robot_model.h"
#include "report/raw_image/raw_png.h"
#include "sightline/v1/optics.pb.h"
#include "sightline/v1/plan.pb.h"
#include "sightline/v1/verification.pb.h"
#include "tests/fuzz/fuzz_inputs.h"
#include "tests/fuzz/fuzz_targets.h"

namespace sightline {
namespace {

// Stands behind the journal and is asked when the journal has no answer.
class NoGainModel final : public GainModel {
 public:
  const TargetBits& measurable() const override { return none_; }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float>) override {
    return std::vector<ScanGain>(measurements.size());
  }
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float>) override {
    return std::vector<ScanGain>(measurements.size());
  }
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    return std::vector<ScanCoverage>(measurements.size());
  }
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    return std::vector<ScanCoverage>(measurements.size());
  }
  int64_t evaluations() const override { return 0; }

 private:
  TargetBits none_{0};
};

// The questions are those that the seed answers.
void ReadJournal(std::string_view bytes) {
  static const MemoryFolder folder;
  const std::string file = folder.Write("answers", bytes);
  auto journal = RecordReplayGainModel::Open(std::make_unique<NoGainModel>(), file, "seed");
  if (!journal.ok()) return;
  const std::vector<Measurement> scans(2);
  (void)(*journal)->Gains(scans, {}).ok();
  (void)(*journal)->ExactCoverage(scans).ok();
  (void)(*journal)->ScorePlan(scans, true).ok();
}

void ReadPareto(std::string_view bytes) {
  const auto front = ReadJson<v1::ParetoFront>(bytes);
  ParetoTask task;
  task.part_digest = ParsePartDigest(front.part_digest()).value_or(PartDigest{});
  task.scene_digest = front.scene_digest();
  task.domain = ThesisDomain();
  task.for_uncertainty = front.for_uncertainty();
  task.judged_targets = front.judged_targets();
  if (!CheckPareto(front, task, "fuzz.json").ok()) return;
  std::vector<ParetoPick> picks(3);
  picks[0].number = 1;
  picks[1].scans = 3;
  picks[2].seconds = 10;
  for (const ParetoPick& pick : picks) {
    const auto index = PickPoint(front, pick, "fuzz.json");
    if (index.ok()) (void)ScansOfPoint(front.points(*index)).size();
  }
  (void)SummarisePareto(front).size();
}

void ReadRobot(std::string_view bytes) {
  RobotMount mount;
  const MemoryFile file(bytes);
  mount.urdf_file = file.path();
  mount.tip_link = "tip";
  const auto model = ReadRobotModel(mount);
  if (model.ok()) (void)model->LinkPoses(model->home).size();
}

void ReadPageRequest(std::string_view bytes) {
  const auto request = ParseRequestBody(std::string(bytes));
  if (!request.ok()) return;
  (void)ReadMeasurement(*request, ThesisDomain()).ok();
  (void)ReadSetting(*request, LimitsOfSetting(Lens{}), {}).ok();
  RequestReader reader(*request, "", {"overwrite", "scan", "action"});
  (void)reader.Flag("overwrite");
  (void)reader.OptionalInteger("scan", 1, 10);
  (void)reader.Word("action", {"add", "remove"});
  (void)reader.status().ok();
}

void ReadFinishedImages(std::string_view bytes) {
  static const MemoryFolder folder;
  folder.Write("images/a.png", "a picture");
  const std::string file = folder.Write("finished", bytes);
  (void)FinishedImages::Open(file, folder.path(), {}, "").ok();
}

}  // namespace

std::map<std::string, FuzzTarget> ClientTargets() {
  return {
      {"plan_json", [](std::string_view bytes) { ReadJson<v1::Plan>(bytes); }},
      {"pareto_json", ReadPareto},
      {"optics_json", [](std::string_view bytes) { ReadJson<v1::OpticsPlan>(bytes); }},
      {"verification_json",
       [](std::string_view bytes) {
         (void)MakeCorrection(ReadJson<v1::Verification>(bytes), "mono", "fuzz.json").ok();
       }},
      {"journal", ReadJournal},
      {"urdf", ReadRobot},
      {"page_request", ReadPageRequest},
      {"finished_images", ReadFinishedImages},
      {"raw_png",
       [](std::string_view bytes) { (void)ReadRawPng(MemoryFile(bytes).path(), 1 << 20).ok(); }},
  };
}

}  // namespace sightline
