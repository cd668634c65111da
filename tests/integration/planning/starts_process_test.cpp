// SPDX-License-Identifier: Apache-2.0
// `sightline plan --starts` as processes: the best of several seeds, in one process or in parts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr char kStartsInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"}, "goal": {"coverage": 0.9},
  "rig": {"part_holding": "PART_HOLDING_FREE"}, "targets": {"required_resolution_m": 0}
})";

// So little effort that seeds differ in their plans.
constexpr char kStartsOptions[] =
    " --evaluations-per-scan 100 --bound-evaluations 2000 --no-pictures --no-point-clouds"
    " --field-directions 576 --strategy greedy-pso-1";

class StartsProcessTest : public BoxProcessTest {
 protected:
  StartsProcessTest() : BoxProcessTest(kStartsInspection) {}

  std::pair<int, std::string> Plan(const std::string& arguments) const {
    return Run(absl::StrCat("plan inspection.json", kStartsOptions, " ", arguments));
  }
  // Bytes of all that does not tell how long things took.
  std::map<std::string, std::string> Files(const std::string& folder) const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ + "/" + folder)) {
      const std::string name = entry.path().lexically_relative(folder_ + "/" + folder).string();
      // Reports and their data tell how long things took.
      if (entry.is_regular_file() && !absl::EndsWith(name, ".html") &&
          !absl::EndsWith(name, "report.json")) {
        files[name] = Bytes(folder + "/" + name);
      }
    }
    return files;
  }
  std::vector<std::string> Names(const std::string& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ + "/" + folder)) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }
};

TEST_F(StartsProcessTest, ThePlanIsThatOfTheBestSeed) {
  const auto [code, output] = Plan("--out all --seed 5 --starts 4");
  ASSERT_EQ(code, 0) << output;
  const auto plan = Read<v1::Plan>("all/plan.json");
  ASSERT_EQ(plan.starts_size(), 4);
  // Every start is what its seed alone gives, and none of them costs less.
  std::vector<double> costs;
  for (int i = 0; i < 4; ++i) {
    const v1::PlanStart& start = plan.starts(i);
    EXPECT_EQ(start.seed(), 5 + i);
    const std::string folder = absl::StrCat("seed-", start.seed());
    ASSERT_EQ(Plan(absl::StrCat("--out ", folder, " --seed ", start.seed())).first, 0);
    const auto alone = Read<v1::Plan>(folder + "/plan.json");
    EXPECT_EQ(alone.starts_size(), 0);
    EXPECT_EQ(start.scans(), alone.scans_size());
    EXPECT_EQ(start.stop_reason(), alone.stop_reason());
    EXPECT_EQ(start.gain_evaluations(), alone.gain_evaluations());
    EXPECT_EQ(start.stop_reason(), v1::Plan::STOP_REASON_GOAL_REACHED);
    // Whole targets, of its own and of validation targets.
    const v1::PlanCoverage& coverage = alone.coverage();
    const auto measurable = static_cast<double>(coverage.measurable_targets());
    const auto by_fresh = static_cast<int64_t>(coverage.fresh_coverage() * measurable);
    EXPECT_DOUBLE_EQ(
        start.settled(),
        static_cast<double>(std::min(coverage.covered_targets(), by_fresh)) / measurable);
    EXPECT_EQ(start.cost(), alone.cost().total());
    costs.push_back(start.cost());
  }
  EXPECT_EQ(plan.cost().total(), *std::min_element(costs.begin(), costs.end()));
  // Otherwise this test would show little.
  EXPECT_NE(*std::min_element(costs.begin(), costs.end()),
            *std::max_element(costs.begin(), costs.end()));
  EXPECT_THAT(output, HasSubstr("4 of 4 starts reached the goal"));
  EXPECT_THAT(output, HasSubstr(absl::StrCat("the best is that of seed ", plan.seed())));

  // Apart from the list of starts all files are those of that seed alone.
  std::map<std::string, std::string> files = Files("all");
  std::map<std::string, std::string> alone = Files(absl::StrCat("seed-", plan.seed()));
  v1::Plan without = plan;
  without.clear_starts();
  EXPECT_EQ(ToJson(without), alone["plan.json"]);
  files.erase("plan.json");
  alone.erase("plan.json");
  EXPECT_EQ(files, alone);
}

TEST_F(StartsProcessTest, PartsInAnyOrderMakeTheSameBytes) {
  ASSERT_EQ(Plan("--out whole --starts 3").first, 0);
  const auto whole = Files("whole");
  const std::string parts = "--out out --starts 3 --checkpoint kept";
  for (const char* part : {" --part 2/2", " --part 1/2"}) {
    const auto [code, output] = Plan(parts + part);
    ASSERT_EQ(code, 0) << output;
    EXPECT_THAT(output, HasSubstr("is done"));
  }
  // They leave results alone, and leave the output folder to the run that chooses.
  EXPECT_THAT(Names("kept"), testing::ElementsAre("start-1.json", "start-2.json", "start-3.json"));
  EXPECT_FALSE(fs::exists(folder_ + "/out"));
  const auto before = fs::last_write_time(folder_ + "/kept/start-2.json");
  ASSERT_EQ(Plan(parts).first, 0);
  EXPECT_EQ(Files("out"), whole);
  EXPECT_EQ(fs::last_write_time(folder_ + "/kept/start-2.json"), before) << "it was planned again";

  // A result that is damaged or missing is made again.
  Write("kept/start-1.json", "half");
  fs::remove(folder_ + "/kept/start-3.json");
  ASSERT_EQ(Plan("--out again --starts 3 --checkpoint kept").first, 0);
  EXPECT_EQ(Files("again"), whole);
  // And those of another question are not taken.
  ASSERT_EQ(Plan("--out other --starts 3 --checkpoint kept --goal 0.6").first, 0);
  ASSERT_EQ(Plan("--out other-whole --starts 3 --goal 0.6").first, 0);
  EXPECT_EQ(Files("other"), Files("other-whole"));
}

TEST_F(StartsProcessTest, SaysWhatDoesNotGoTogether) {
  for (const auto& [arguments, words] :
       {std::pair("--starts 3 --part 1/2", "--checkpoint"),
        std::pair("--starts 3 --checkpoint c --part 3/2", "K/N"),
        std::pair("--starts 3 --checkpoint c --part 1/4", "there are 3 starts"),
        std::pair("--checkpoint c --part 1/2", "there are 1 starts"),
        std::pair("--starts 2 --pareto", "exclude each other"),
        std::pair("--starts 2 --optics", "exclude each other"),
        std::pair("--starts 2 --seed 9223372036854775807", "9223372036854775806"),
        std::pair("--starts 0", "--starts")}) {
    const auto [code, output] = Run(absl::StrCat("plan inspection.json --out out ", arguments));
    EXPECT_EQ(code, 2) << arguments << output;
    EXPECT_THAT(output, HasSubstr(words)) << arguments;
    EXPECT_FALSE(fs::exists(folder_ + "/out")) << arguments;
  }
}

TEST_F(StartsProcessTest, StoppedItKeepsTheBestSoFar) {
  // Interrupted during the second of very many starts.
  const ProcessResult result = RunProcess(absl::StrCat(
      "cd ", folder_, " && ", BinFolder(),
      "/sightline --progress json plan inspection.json --out a --starts 1000 --goal 0.4 ",
      "--evaluations-per-scan 2000 --bound-evaluations 0 --no-pictures --no-point-clouds ",
      "--strategy greedy-pso --field-directions 576 --checkpoint kept 2>progress & ",
      "while kill -0 $! && ! grep -q 'start 2 of 1000' ", folder_,
      "/progress; do sleep 0.01; done; kill -TERM $!; wait $!"));
  EXPECT_EQ(result.exit_code, 130) << result.output << Bytes("progress");
  const auto plan = Read<v1::Plan>("a/plan.json");
  EXPECT_GE(plan.starts_size(), 1);
  EXPECT_LT(plan.starts_size(), 1000);
  EXPECT_GE(plan.scans_size(), 1);
  EXPECT_FALSE(Bytes("a/report.html").empty());
}

}  // namespace
}  // namespace sightline
