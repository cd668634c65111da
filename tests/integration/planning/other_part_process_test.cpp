// SPDX-License-Identifier: Apache-2.0
// Every command that takes a plan refuses one of another part, unless --other-part is given.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "planner_client/command_line/command_table.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kOtherPartInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"}, "goal": {"coverage": 0.9},
  "rig": {"part_holding": "PART_HOLDING_FREE"}, "targets": {"required_resolution_m": 0}
})";

constexpr char kOtherPartToleranced[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "uncertainty": {"line_detection": {"standard_deviation_px": 0.1}, "calibration": {},
    "registration": "NONE"},
  "tolerances": {"zone_width_m": 0.0004}
})";

constexpr char kOtherPartImaging[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "camera": {"sensor": {"name": "small", "sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
    "sensor_columns_px": 128, "sensor_rows_px": 64, "bit_depth_bit": 10,
    "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
    "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.57,
    "dark_noise_electrons": 6.5, "dark_current_electrons_per_s": 0, "mount": "C"}},
  "lens": {"focal_length_m": 0.016, "f_number": 8},
  "laser": {"power_w": 0.005, "fan_angle_deg": 40},
  "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.5}}}]
})";

// A way in which a command takes a plan: {plan} is the file, out/plan.json the same. A command that
// takes one anew joins by a line.
struct PlanUse {
  const char* command;
  const char* arguments;
};
constexpr PlanUse kPlanUses[] = {
    {"plan", "tall.json --keep {plan} --out new"},
    {"plan", "tall.json --resume --out out"},
    {"evaluate", "tall.json {plan} --out new"},
    {"render", "tall_imaging.json --plan {plan} --out new"},
    {"render", "tall_imaging.json --scan 1 --out out"},
    {"optics", "tall_imaging.json --plan {plan} --out new"},
    {"explore", "tall.json --plan {plan} --listen 127.0.0.1:0 --out new"},
    {"inspect", "tall_toleranced.json --plan {plan} --measured points.ply --out new"},
};

class OtherPartProcessTest : public BoxProcessTest {
 protected:
  OtherPartProcessTest() : BoxProcessTest(kOtherPartInspection) {}

  // plan.json of the box, and inspections of another revision: 24 mm high where that has 20 mm.
  void SetUp() override {
    BoxProcessTest::SetUp();
    Write("tall.obj", absl::StrReplaceAll(Bytes("box.obj"), {{" 20\n", " 24\n"}}));
    ASSERT_NE(Bytes("tall.obj"), Bytes("box.obj"));
    const std::pair<std::string, std::string> tall = {"box.obj", "tall.obj"};
    Write("tall.json", absl::StrReplaceAll(kOtherPartInspection, {tall}));
    Write("tall_imaging.json", absl::StrReplaceAll(kOtherPartImaging, {tall}));
    Write("tall_toleranced.json", absl::StrReplaceAll(kOtherPartToleranced, {tall}));
    Write("by_hand.json", R"({"scans": [{"measurement": {"camera_distance_m": 0.3,
                              "triangulation_angle_deg": 30}}]})");
    const auto [code, output] =
        Run("evaluate inspection.json by_hand.json --out out --no-pictures --no-point-clouds");
    ASSERT_EQ(code, 0) << output;
    plan_ = Read<v1::Plan>("out/plan.json");
    ASSERT_THAT(plan_.part_digest(), HasSubstr(":"));
    ASSERT_EQ(plan_.part_remarks_size(), 0);
    Write("old.json", Bytes("out/plan.json"));
  }

  v1::Plan plan_;
};

TEST_F(OtherPartProcessTest, EveryCommandRefusesIt) {
  for (const PlanUse& use : kPlanUses) {
    const std::string arguments = absl::StrReplaceAll(use.arguments, {{"{plan}", "old.json"}});
    const auto [code, output] = Run(absl::StrCat(use.command, " ", arguments));
    EXPECT_EQ(code, 2) << use.command << " " << arguments << "\n" << output;
    EXPECT_THAT(output, AllOf(HasSubstr("part_digest is " + plan_.part_digest()),
                              HasSubstr("tall.obj is "), HasSubstr("--other-part")))
        << use.command << " " << arguments;
    // A refused plan leaves no files.
    EXPECT_FALSE(fs::exists(folder_ + "/new/plan.json")) << arguments;
  }
}

TEST_F(OtherPartProcessTest, EveryCommandThatTakesAPlanIsInTheTable) {
  std::set<std::string> tested;
  for (const PlanUse& use : kPlanUses) tested.insert(use.command);
  const std::regex takes_plan(R"((^|\n) +(--plan|--keep|--resume|plan TEXT)\b)");
  for (const CommandEntry& command : kCommands) {
    const std::string name(command.name);
    const auto [code, help] = Run(name + " --help");
    ASSERT_EQ(code, 0) << help;
    EXPECT_EQ(std::regex_search(help, takes_plan), tested.contains(name)) << help;
    EXPECT_EQ(help.find("--other-part") != std::string::npos, tested.contains(name)) << name;
  }
}

TEST_F(OtherPartProcessTest, TakenAllTheSameItIsSaidFirst) {
  const std::string quick = " --no-pictures --no-point-clouds --other-part --out new";
  for (const std::string& arguments :
       {"evaluate tall.json old.json" + quick,
        "plan tall.json --keep old.json --max-scans 1 --evaluations-per-scan 10 "
        "--bound-evaluations 0 --no-fresh-targets --field-directions 576" +
            quick}) {
    const auto [code, output] = Run(arguments);
    ASSERT_EQ(code, 0) << arguments << "\n" << output;
    const auto plan = Read<v1::Plan>("new/plan.json");
    ASSERT_EQ(plan.part_remarks_size(), 1) << arguments;
    EXPECT_THAT(plan.part_remarks(0),
                AllOf(HasSubstr("old.json"), HasSubstr("another part"), HasSubstr("tall.obj"),
                      HasSubstr(plan_.part_digest()), HasSubstr(plan.part_digest())));
    EXPECT_THAT(output, HasSubstr("warning: " + plan.part_remarks(0)));
    EXPECT_THAT(Bytes("new/report.html"),
                HasSubstr("\"finding\":[{\"text\":\"" + plan.part_remarks(0)));
    // From now on it is a plan of this part.
    const auto [again, said] =
        Run("evaluate tall.json new/plan.json --out again --no-pictures --no-point-clouds");
    EXPECT_EQ(again, 0) << said;
    EXPECT_EQ(Read<v1::Plan>("again/plan.json").part_remarks_size(), 0);
  }
}

TEST_F(OtherPartProcessTest, PlansByHandAndOfAnOlderRuleAreTaken) {
  const std::string quick = " --no-pictures --no-point-clouds --out new";
  ASSERT_EQ(Run("evaluate tall.json by_hand.json" + quick).first, 0);
  EXPECT_EQ(Read<v1::Plan>("new/plan.json").part_remarks_size(), 0);
  // Bare digits are of rule 1.
  v1::Plan older = plan_;
  older.set_part_digest(older.part_digest().substr(older.part_digest().find(':') + 1));
  Write("older.json", ToJson(older));
  const auto [code, output] = Run("evaluate tall.json older.json" + quick);
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("warning: older.json"), HasSubstr("rule 1"),
                            Not(HasSubstr("another part"))));
  older.set_part_digest("no digest");
  Write("older.json", ToJson(older));
  EXPECT_EQ(Run("evaluate tall.json older.json --other-part" + quick).first, 2);
}

}  // namespace
}  // namespace sightline
