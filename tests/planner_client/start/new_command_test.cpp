// SPDX-License-Identifier: Apache-2.0
// `sightline new` and the inspections that it writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/inspection/part_holding.h"
#include "core/inspection/read_with_files.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/physics/angle.h"
#include "planner_client/commands/commands.h"
#include "planner_client/inspection_draft/inspection_draft.h"
#include "tests/planner_client/run_command.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// 60 x 40 x 20.
constexpr char kBox[] =
    "v 0 0 0\nv 60 0 0\nv 60 40 0\nv 0 40 0\nv 0 0 20\nv 60 0 20\nv 60 40 20\nv 0 40 20\n"
    "f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\n"
    "f 4 1 5\nf 4 5 8\n";

class NewCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    std::ofstream(folder_ + "/box.obj") << kBox;
  }
  void TearDown() override { fs::remove_all(folder_); }

  CommandResult New(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), folder_ + "/box.obj");
    arguments.insert(arguments.end(), {"--out", out_, "--no-questions"});
    return RunCommand(AddNewCommand, arguments);
  }
  static std::string Text(const std::string& path) {
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  static std::string Catalogue() {
    return std::string(std::getenv("SIGHTLINE_SOURCE_DIR")) + "/examples/catalogue";
  }

  std::string folder_ = "/tmp/sightline-new-XXXXXX";
  std::string out_;
};

TEST_F(NewCommandTest, WritesAnInspectionThatCanBeRead) {
  out_ = folder_ + "/tasks/inspection.json";
  const CommandResult made = New({"--unit", "mm"});
  ASSERT_EQ(made.exit_code, kExitDone) << made.errors;
  EXPECT_THAT(made.output, AllOf(HasSubstr("60 x 40 x 20 mm"), HasSubstr("sightline plan ")));
  const auto inspection = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->name, "box");
  EXPECT_EQ(inspection->part_file, folder_ + "/box.obj");
  EXPECT_EQ(inspection->goal.coverage, 0.95);
  // 88 square centimetres with about 8000 targets.
  EXPECT_NEAR(inspection->targets.spacing_m, 1e-3, 1e-9);
  EXPECT_LT(inspection->targets.coverage_radius_m, inspection->targets.spacing_m);
  EXPECT_LE(3 * inspection->rig.scan_step_m, inspection->targets.coverage_radius_m + 1e-9);
  const std::string text = Text(out_);
  EXPECT_THAT(
      text, AllOf(HasSubstr("// Written by `sightline new`"), HasSubstr("\"../box.obj\""),
                  HasSubstr("PART_HOLDING_RESTING"), HasSubstr("\"coverage_radius_m\": 0.0006\n")));
  // An existing file is not overwritten.
  const CommandResult again = New({"--unit", "mm"});
  EXPECT_EQ(again.exit_code, kExitWrongInput);
  EXPECT_THAT(again.errors, HasSubstr("--force"));
  EXPECT_EQ(New({"--unit", "mm", "--force", "--holding", "free"}).exit_code, kExitDone);
  EXPECT_THAT(Text(out_), HasSubstr("\"part_holding\": \"PART_HOLDING_FREE\""));
}

// A camera and a laser that measure the range of the data sheet: 190 to 400 mm, 96 to 194 mm wide.
TEST_F(NewCommandTest, TakesAProfileSensorOfTheCatalogue) {
  out_ = folder_ + "/sensor.json";
  const CommandResult no_angle =
      New({"--unit", "mm", "--catalogue", Catalogue(), "--sensor", "gocator_2340"});
  EXPECT_EQ(no_angle.exit_code, kExitWrongInput);
  EXPECT_THAT(no_angle.errors, AllOf(HasSubstr("--triangulation-angle-deg is missing"),
                                     HasSubstr("LMI Gocator 2340")));
  const CommandResult made = New({"--unit", "mm", "--catalogue", Catalogue(), "--sensor",
                                  "gocator_2340", "--triangulation-angle-deg", "30"});
  ASSERT_EQ(made.exit_code, kExitDone) << made.errors;
  const auto inspection = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->sensor_mount, SensorMount::kRigid);
  const Rig& rig = inspection->rig;
  EXPECT_NEAR(rig.laser.distance_m.value_or(0), 0.295, 1e-12);
  EXPECT_EQ(rig.camera.columns_px, 1280);
  ASSERT_EQ(inspection->domain.parameters[kCameraDistance].values.size(), 1u);
  const double distance_m = inspection->domain.parameters[kCameraDistance].values[0];
  EXPECT_NEAR(distance_m, 0.295 / std::cos(30 * kRadPerDeg), 1e-6);
  // In the middle the line is 145 mm long, over all columns.
  EXPECT_NEAR(rig.camera.columns_px / rig.camera.FocalLengthPx() * distance_m, 0.145, 1e-4);
  // Both ends of the laser's axis are in the image, and the near one is at its edge.
  const auto row_of = [&](double s_m) {
    return rig.camera.FocalLengthPx() * s_m * std::sin(30 * kRadPerDeg) /
           (distance_m - s_m * std::cos(30 * kRadPerDeg));
  };
  EXPECT_LE(row_of(0.105), 0.5 * rig.camera.rows_px);
  EXPECT_GT(row_of(0.105), 0.5 * rig.camera.rows_px - 2);
  EXPECT_LE(-row_of(-0.105), 0.5 * rig.camera.rows_px);
  EXPECT_NEAR(std::tan(0.5 * rig.laser.fan_angle_rad) * 0.4, 0.097, 1e-4);
  // The far corner of the range is in range, 5 mm beyond is not.
  EXPECT_NEAR(rig.max_range_m, std::hypot(0.0525, distance_m + 0.0909, 0.097), 1e-3);
}

TEST_F(NewCommandTest, RefusesWhatDoesNotGoWithAProfileSensor) {
  out_ = folder_ + "/sensor.json";
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--camera", "bfly_pge_13e4m"}, "--camera and --sensor exclude each other"},
      {{"--stand-off-mm", "250"}, "--stand-off-mm and --sensor exclude each other"},
      {{"--rig", "free"}, "--sensor is for --rig rigid and --rig robot"},
      {{"--fov-deg", "30"}, "--fov-deg and --sensor exclude each other"},
  };
  for (const auto& [options, message] : cases) {
    std::vector<std::string> arguments = {"--unit",    "mm",       "--catalogue",
                                          Catalogue(), "--sensor", "gocator_2350"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    if (options[0] != "--rig") {
      arguments.insert(arguments.end(), {"--triangulation-angle-deg", "30"});
    }
    const CommandResult made = New(arguments);
    EXPECT_EQ(made.exit_code, kExitWrongInput);
    EXPECT_THAT(made.errors, HasSubstr(message));
  }
  const CommandResult unknown =
      New({"--unit", "mm", "--catalogue", Catalogue(), "--sensor", "gocator_2345"});
  EXPECT_THAT(unknown.errors, HasSubstr("no sensor of that name"));
}

TEST_F(NewCommandTest, WritesTheRigAsItIsBought) {
  out_ = folder_ + "/rigid.json";
  const CommandResult made = New({"--unit", "mm", "--rig", "rigid", "--triangulation-angle-deg",
                                  "30", "--stand-off-mm", "250", "--fixed-height"});
  ASSERT_EQ(made.exit_code, kExitDone) << made.errors;
  const auto rigid = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(rigid.ok()) << rigid.status();
  EXPECT_EQ(rigid->sensor_mount, SensorMount::kRigid);
  EXPECT_FALSE(rigid->stage_moves_in_height);
  EXPECT_EQ(rigid->costs.move_sensors_time_s, 60);
  EXPECT_EQ(rigid->rig.laser.distance_m, 0.25);
  // The camera beside the laser: 250 mm / cos 30 deg.
  ASSERT_EQ(rigid->domain.parameters[kCameraDistance].values.size(), 1u);
  EXPECT_NEAR(rigid->domain.parameters[kCameraDistance].values[0], 0.288675, 1e-6);
  EXPECT_NEAR(rigid->domain.parameters[kTriangulationAngle].values.at(0), 30 * kRadPerDeg, 1e-9);

  out_ = folder_ + "/steps.json";
  const CommandResult steps = New({"--unit", "mm", "--angle-step-deg", "15"});
  ASSERT_EQ(steps.exit_code, kExitDone) << steps.errors;
  const auto free = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(free.ok()) << free.status();
  EXPECT_EQ(free->costs.move_sensors_time_s, 900);
  EXPECT_EQ(free->domain.parameters[kPartGamma].values.size(), 24u);
  EXPECT_EQ(free->domain.parameters[kCameraPolar].values.size(), 7u);

  out_ = folder_ + "/table.json";
  EXPECT_THAT(New({"--unit", "mm", "--rig", "turntable"}).errors, HasSubstr("--urdf"));
  EXPECT_THAT(New({"--unit", "mm", "--rig", "rigid", "--stand-off-mm", "250"}).errors,
              HasSubstr("--triangulation-angle-deg"));
  const CommandResult table =
      New({"--unit", "mm", "--rig", "turntable", "--urdf", "table.urdf", "--tip-link", "plate"});
  ASSERT_EQ(table.exit_code, kExitDone) << table.errors;
  const auto turned = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(turned.ok() && turned->robot) << turned.status();
  EXPECT_EQ(turned->robot->load, RobotMount::Load::kPart);
  EXPECT_EQ(turned->costs.lay_time_s, 0);
}

// The same as an inspection that says nothing about it gets: 75 mm of diameter.
TEST_F(NewCommandTest, ThePartIsShiftedByItsOwnSize) {
  out_ = folder_ + "/i.json";
  ASSERT_EQ(New({"--unit", "mm"}).exit_code, kExitDone);
  std::ofstream(folder_ + "/bare.json") << R"({"part": {"file": "box.obj", "unit": "mm"}})";
  const auto part = LoadPart(folder_ + "/box.obj", "mm");
  ASSERT_TRUE(part.ok()) << part.status();
  auto bare = ReadInspectionWithFiles(folder_ + "/bare.json");
  const auto written = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(bare.ok() && written.ok());
  ASSERT_TRUE(HoldPart(*part, &*bare).ok());
  for (const int offset : {kOffsetY, kOffsetZ}) {
    EXPECT_EQ(bare->domain.parameters[offset].ranges.at(0).max, 0.08);
    EXPECT_EQ(written->domain.parameters[offset].ranges.at(0).min, -0.08);
    EXPECT_EQ(written->domain.parameters[offset].ranges.at(0).max, 0.08);
  }
}

TEST_F(NewCommandTest, NamesAllThatIsMissing) {
  out_ = folder_ + "/i.json";
  std::ofstream(out_) << "{}";
  const CommandResult wrong = New({"--tolerances", "none.stp"});
  EXPECT_EQ(wrong.exit_code, kExitWrongInput);
  EXPECT_THAT(wrong.errors,
              AllOf(HasSubstr("--unit is missing"), HasSubstr("mm: 60 x 40 x 20 mm"),
                    HasSubstr("inch: 1524 x 1016 x 508 mm"), Not(HasSubstr("um: ")),
                    HasSubstr("is there already"), HasSubstr("none.stp: no such file")));
  EXPECT_EQ(Text(out_), "{}");
}

TEST_F(NewCommandTest, TakesDevicesOfACatalogue) {
  out_ = folder_ + "/i.json";
  const CommandResult made =
      New({"--unit", "mm", "--catalogue", Catalogue(), "--camera", "13e4m", "--laser", "z_laser"});
  ASSERT_EQ(made.exit_code, kExitDone) << made.errors;
  EXPECT_THAT(made.output, HasSubstr("lens chosen: "));
  const auto inspection = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->sensor->columns_px, 1280);
  ASSERT_TRUE(inspection->rig.lens);
  EXPECT_NEAR(inspection->rig.laser.fan_angle_rad, 30 * M_PI / 180, 1e-12);
  // At its working distance the camera sees about the part.
  const double width_m =
      0.2 * inspection->rig.camera.columns_px * 5.3e-6 / inspection->rig.lens->focal_length_m;
  EXPECT_GT(width_m, 0.03);
  EXPECT_LT(width_m, 0.15);
  const CommandResult wrong = New({"--unit", "mm", "--force", "--catalogue", Catalogue(),
                                   "--camera", "bfy_pge_13e4m", "--laser", "lm9"});
  EXPECT_THAT(wrong.errors, AllOf(HasSubstr("the nearest is bfly_pge_13e4m"),
                                  HasSubstr("--laser lm9: may be any of iadiy_lm9g520h50l60t, ")));
  EXPECT_THAT(New({"--unit", "mm", "--force", "--catalogue", Catalogue(), "--camera", "13e4m",
                   "--rows", "100"})
                  .errors,
              HasSubstr("--rows is that of the camera already"));
}

TEST_F(NewCommandTest, PlansForATolerance) {
  out_ = folder_ + "/i.json";
  ASSERT_EQ(New({"--unit", "mm", "--tolerance-mm", "0.2", "--goal", "0.8", "--pixel-pitch-um", "5",
                 "--rows", "1000", "--focal-length-mm", "16"})
                .exit_code,
            kExitDone);
  const auto inspection = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->goal.admissible, 0.8);
  EXPECT_NEAR(*inspection->tolerances->zone_width_m, 2e-4, 1e-12);
  EXPECT_NEAR(inspection->rig.camera.vertical_fov_rad, 2 * std::atan(0.5 * 5e-3 / 16e-3), 1e-5);
}

// A flatness of 0.2 of a unit that the file does or does not state.
std::string QifOf(const std::string& units) {
  return R"(<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">)" + units +
         R"(<Features><FeatureNominals><PlaneFeatureNominal id="1"/></FeatureNominals></Features>
  <Characteristics><CharacteristicDefinitions><FlatnessCharacteristicDefinition id="2">
  <ToleranceValue>0.2</ToleranceValue></FlatnessCharacteristicDefinition></CharacteristicDefinitions>
  <CharacteristicNominals><FlatnessCharacteristicNominal id="3">
  <CharacteristicDefinitionId>2</CharacteristicDefinitionId><FeatureNominalIds><Id>1</Id>
  </FeatureNominalIds></FlatnessCharacteristicNominal></CharacteristicNominals></Characteristics>
</QIFDocument>)";
}

TEST_F(NewCommandTest, TheUnitOfToleranceFilesIsStatedOnce) {
  out_ = folder_ + "/i.json";
  const std::string none = folder_ + "/none.qif", inch = folder_ + "/inch.qif";
  std::ofstream(none) << QifOf("");
  std::ofstream(inch) << QifOf(
      "<FileUnits><PrimaryUnits><LinearUnit><UnitName>inch</UnitName></LinearUnit></PrimaryUnits>"
      "</FileUnits>");
  const auto with = [&](const std::string& file, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--unit", "mm", "--force", "--tolerances", file};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return New(arguments);
  };
  const CommandResult missing = with(none, {});
  EXPECT_EQ(missing.exit_code, kExitWrongInput);
  EXPECT_THAT(missing.errors, HasSubstr("--tolerances-unit"));
  EXPECT_FALSE(fs::exists(out_));
  ASSERT_EQ(with(none, {"--tolerances-unit", "millimetre"}).exit_code, kExitDone);
  const auto inspection = ReadInspectionWithFiles(out_);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->tolerances->file_unit, "mm");

  EXPECT_EQ(with(inch, {}).exit_code, kExitDone);
  const CommandResult twice = with(inch, {"--tolerances-unit", "mm"});
  EXPECT_EQ(twice.exit_code, kExitWrongInput);
  EXPECT_THAT(twice.errors, AllOf(HasSubstr("inch.qif:"), HasSubstr("states its unit, inch")));
  EXPECT_EQ(New({"--unit", "mm", "--tolerances-unit", "mm", "--force"}).exit_code, kExitWrongInput);
}

// The field of view that is written is that of pixels and lens, however the lens is named, or the
// command refuses.
TEST_F(NewCommandTest, TheFieldOfViewIsThatOfPixelsAndLens) {
  out_ = folder_ + "/i.json";
  const std::vector<std::string> by_length = {"--focal-length-mm", "16"};
  const std::vector<std::string> by_name = {"--catalogue", Catalogue(), "--lens", "kowa_lm16fc24m"};
  for (const std::vector<std::string>& lens : {by_length, by_name}) {
    std::vector<std::string> arguments = {"--unit", "mm", "--rows", "1024", "--force"};
    arguments.insert(arguments.end(), lens.begin(), lens.end());
    const CommandResult missing = New(arguments);
    EXPECT_EQ(missing.exit_code, kExitWrongInput);
    EXPECT_THAT(missing.errors, HasSubstr("--pixel-pitch-um is missing"));
    EXPECT_FALSE(fs::exists(out_));

    arguments.insert(arguments.end(), {"--pixel-pitch-um", "5.5"});
    ASSERT_EQ(New(arguments).exit_code, kExitDone);
    const auto inspection = ReadInspectionWithFiles(out_);
    ASSERT_TRUE(inspection.ok()) << inspection.status();
    const double focal_length_m = inspection->rig.lens->focal_length_m;
    EXPECT_NEAR(focal_length_m, 0.016, 1e-3);
    EXPECT_NEAR(inspection->rig.camera.vertical_fov_rad,
                2 * std::atan(0.5 * 1024 * 5.5e-6 / focal_length_m), 1e-5);
    fs::remove(out_);

    arguments.insert(arguments.end(), {"--fov-deg", "40"});
    const CommandResult other = New(arguments);
    EXPECT_EQ(other.exit_code, kExitWrongInput);
    EXPECT_THAT(other.errors, AllOf(HasSubstr("vertical_fov_deg is 40"), HasSubstr("1024 rows")));
    EXPECT_FALSE(fs::exists(out_));
  }
  // A stated field of view needs no pitch.
  EXPECT_EQ(New({"--unit", "mm", "--focal-length-mm", "16", "--fov-deg", "20"}).exit_code,
            kExitDone);
}

// An option takes what the field takes that it sets, and nothing else: at the ends of every range.
TEST_F(NewCommandTest, OptionsHaveTheRangesOfTheirFields) {
  out_ = folder_ + "/i.json";
  struct Option {
    std::string name, taken, refused;
    std::vector<std::string> beside;
  };
  const std::vector<Option> options = {
      {"--focal-length-mm", "1", "0.5", {"--fov-deg", "20"}},
      {"--focal-length-mm", "99.9", "100", {"--fov-deg", "20"}},
      {"--fov-deg", "169.9", "170", {}},
      {"--fov-deg", "0.01", "0", {}},
      {"--columns", "16", "15", {}},
      {"--rows", "16384", "16385", {}},
      {"--f-number", "0.5", "0.4", {"--focal-length-mm", "16", "--fov-deg", "20"}},
      {"--f-number", "128", "129", {"--focal-length-mm", "16", "--fov-deg", "20"}},
      {"--goal", "1", "1.01", {}},
      {"--goal", "1e-7", "0", {}},
      {"--spacing-mm", "1000", "1001", {}},
      {"--tolerance-mm", "1000", "1001", {}},
  };
  for (const Option& option : options) {
    std::vector<std::string> arguments = {"--unit", "mm", "--force"};
    arguments.insert(arguments.end(), option.beside.begin(), option.beside.end());
    arguments.insert(arguments.end(), {option.name, option.taken});
    const CommandResult taken = New(arguments);
    EXPECT_EQ(taken.exit_code, kExitDone) << option.name << " " << option.taken << taken.errors;
    arguments.back() = option.refused;
    const CommandResult refused = New(arguments);
    EXPECT_EQ(refused.exit_code, kExitWrongInput) << option.name << " " << option.refused;
    EXPECT_THAT(refused.errors, AllOf(HasSubstr(option.name), HasSubstr("must be in ")));
  }
}

TEST(SpacingFor, GivesAboutEightThousandTargets) {
  for (const double area_m2 : {1e-4, 1e-2, 0.3, 2.0}) {
    const double spacing_m = SpacingFor(area_m2);
    const double targets = 0.89 * area_m2 / (spacing_m * spacing_m);
    EXPECT_GT(targets, 4000) << area_m2;
    EXPECT_LT(targets, 16000) << area_m2;
  }
  EXPECT_EQ(SpacingFor(1e-12), 1e-4);
  EXPECT_EQ(SpacingFor(0), 1e-4);
}

TEST(CommentedJson, PutsCommentsBeforeFields) {
  v1::Inspection message;
  message.set_name("a \"b\": c");
  message.mutable_targets()->set_spacing_m(1);
  message.mutable_goal()->set_coverage(0.5);
  const std::string text = CommentedJson(
      message,
      {{"", "All."}, {"targets.spacing_m", "Far."}, {"goal", "Enough."}, {"rig", "None."}});
  EXPECT_EQ(text,
            "// All.\n{\n  \"name\": \"a \\\"b\\\": c\",\n  \"targets\": {\n    // Far.\n"
            "    \"spacing_m\": 1\n  },\n  // Enough.\n  \"goal\": {\n    \"coverage\": 0.5\n  }\n"
            "}\n");
  v1::Inspection read;
  ASSERT_TRUE(ParseStrictJson(text, "f", &read).ok());
  EXPECT_EQ(read.SerializeAsString(), message.SerializeAsString());
}

}  // namespace
}  // namespace sightline
