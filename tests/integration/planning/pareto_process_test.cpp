// SPDX-License-Identifier: Apache-2.0
// `sightline plan --pareto` and `--pick` as processes, with the server they start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "sightline/v1/pareto.pb.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

constexpr char kParetoInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"}, "goal": {"coverage": 0.9},
  "rig": {"part_holding": "PART_HOLDING_FREE"}, "targets": {"required_resolution_m": 0},
  "costs": {"stage_speed_m_per_s": 0.02, "frame_rate_hz": 50, "reposition_time_s": 2,
            "reposition_speed_deg_per_s": 30, "reposition_speed_m_per_s": 0.1}
})";

constexpr char kParetoOptions[] =
    " --evaluations-per-scan 400 --bound-evaluations 0 --no-pictures --no-point-clouds"
    " --field-directions 576";

class ParetoProcessTest : public BoxProcessTest {
 protected:
  ParetoProcessTest() : BoxProcessTest(kParetoInspection) {}
};

TEST_F(ParetoProcessTest, PlansAFrontAndThePlanFollowsThePick) {
  const std::string plan_options =
      std::string("plan inspection.json --out ") + "a" + kParetoOptions;
  const auto [code, output] = Run(plan_options + " --pareto");
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("Pareto front"));
  const auto front = Read<v1::ParetoFront>("a/pareto.json");
  ASSERT_GE(front.points_size(), 2);
  EXPECT_THAT(Bytes("a/report.html"), HasSubstr("Fewer scans or less time"));

  // plan.json is the chosen point, and no worse than the plan alone.
  const auto plan = Read<v1::Plan>("a/plan.json");
  const v1::ParetoPoint& chosen = front.points(front.chosen() - 1);
  EXPECT_TRUE(chosen.reaches_goal());
  EXPECT_EQ(plan.scans_size(), chosen.scans());
  EXPECT_EQ(plan.coverage().covered_targets(), chosen.settled_targets());
  EXPECT_NEAR(plan.cost().total(), chosen.time_s(), 1e-9);
  ASSERT_EQ(Run(std::string("plan inspection.json --out alone") + kParetoOptions).first, 0);
  EXPECT_LE(plan.scans_size(), Read<v1::Plan>("alone/plan.json").scans_size());

  // Same seed, same bytes.
  ASSERT_EQ(Run(std::string("plan inspection.json --out b --pareto") + kParetoOptions).first, 0);
  EXPECT_EQ(Bytes("a/pareto.json"), Bytes("b/pareto.json"));

  // Another point, and what `evaluate` says of it.
  const std::string pick =
      "plan inspection.json --out a --no-pictures --no-point-clouds --field-directions 576 ";
  const int other = front.chosen() == 1 ? 2 : 1;
  const auto [picked, said] = Run(absl::StrCat(pick, "--pick ", other));
  ASSERT_EQ(picked, 0) << said;
  const v1::ParetoPoint& point = front.points(other - 1);
  const auto follows = Read<v1::Plan>("a/plan.json");
  EXPECT_EQ(follows.scans_size(), point.scans());
  EXPECT_EQ(follows.coverage().covered_targets(), point.settled_targets());
  EXPECT_NEAR(follows.cost().total(), point.time_s(), 1e-9);
  EXPECT_EQ(Read<v1::ParetoFront>("a/pareto.json").chosen(), other);
  ASSERT_EQ(Run("evaluate inspection.json a/plan.json --out c --no-pictures").first, 0);
  EXPECT_EQ(Read<v1::Plan>("c/plan.json").coverage().covered_targets(), point.settled_targets());

  // Back to the first choice, by what it needs.
  ASSERT_EQ(Run(absl::StrCat(pick, "--pick ", front.chosen())).first, 0);
  EXPECT_EQ(Bytes("a/pareto.json"), Bytes("b/pareto.json"));
  ASSERT_EQ(Run(pick + "--pick-seconds 1000000").first, 0);

  // A point that does not exist is refused.
  const auto [beside, why] = Run(absl::StrCat(pick, "--pick ", front.points_size() + 1));
  EXPECT_EQ(beside, 2);
  EXPECT_THAT(why, HasSubstr(absl::StrCat("points 1 to ", front.points_size())));
  EXPECT_THAT(Run(pick + "--pick-seconds 0").second, HasSubstr("the quickest plan"));

  // Numbers that were changed, another cost model, another part.
  const std::string good = Bytes("a/pareto.json");
  auto changed = Read<v1::ParetoFront>("a/pareto.json");
  changed.mutable_points(0)->set_settled_targets(point.settled_targets() + 1);
  Write("a/pareto.json", ToJson(changed));
  const auto [refused, field] = Run(pick + "--pick 1");
  EXPECT_EQ(refused, 2);
  EXPECT_THAT(field, HasSubstr("a/pareto.json: points[0].settled_targets"));
  Write("a/pareto.json", good);
  Write(
      "inspection.json",
      absl::StrReplaceAll(kParetoInspection, {{"\"frame_rate_hz\": 50", "\"frame_rate_hz\": 60"}}));
  EXPECT_THAT(Run(pick + "--pick 1").second, HasSubstr("costs.frame_rate_hz is 50, must be 60"));
  Write("inspection.json", kParetoInspection);
  Write("box.obj", absl::StrReplaceAll(Bytes("box.obj"), {{"60", "61"}}));
  EXPECT_THAT(Run(pick + "--pick 1").second, HasSubstr("a/pareto.json: part_digest"));
}

TEST_F(ParetoProcessTest, StoppedItKeepsTheFrontSoFar) {
  // Interrupted as soon as it plans beyond the first plan, with effort for minutes.
  const ProcessResult result = RunProcess(absl::StrCat(
      "cd ", folder_, " && ", BinFolder(),
      "/sightline --progress json plan inspection.json --out a --pareto --goal 0.4 ",
      "--evaluations-per-scan 400000 --bound-evaluations 0 --no-pictures --no-point-clouds ",
      "--field-directions 576 2>progress & while kill -0 $! && ! grep -q 'front, ' ", folder_,
      "/progress; do sleep 0.1; done; kill -TERM $!; wait $!"));
  EXPECT_EQ(result.exit_code, 130) << result.output << Bytes("progress");
  const auto front = Read<v1::ParetoFront>("a/pareto.json");
  EXPECT_GE(front.points_size(), 1);
  EXPECT_EQ(front.stop_reason(), v1::Plan::STOP_REASON_INTERRUPTED);
  EXPECT_NE(Bytes("a/report.html").find("not finished: it was interrupted"), std::string::npos);
  EXPECT_GE(Read<v1::Plan>("a/plan.json").scans_size(), 1);
}

TEST_F(ParetoProcessTest, SaysWhatIsMissing) {
  const auto [code, output] = Run("plan inspection.json --out none --pick 1");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(output, HasSubstr("none/pareto.json"));
  EXPECT_THAT(Run("plan inspection.json --out a --pareto --strategy matrix").second,
              HasSubstr("--strategy refined"));
  EXPECT_THAT(Run("plan inspection.json --out a --pick 1 --pick-scans 2").second,
              HasSubstr("exclude each other"));
  EXPECT_THAT(Run("plan inspection.json --out a --pareto --pick 1").second,
              HasSubstr("exclude each other"));
}

}  // namespace
}  // namespace sightline
