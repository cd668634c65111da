// SPDX-License-Identifier: Apache-2.0
// `sightline diagnose` and `sightline verify` with a worker in this process whose findings are
// injected.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/commands/commands.h"
#include "planner_client/render_client/render_client.h"
#include "render_worker/calibration/inspection_change.h"
#include "render_worker/service/render_server.h"
#include "tests/planner_client/run_command.h"
#include "tests/render_worker/service/plate_spec.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string Bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

constexpr char kTable[] =
    "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";

// Somebody presses Ctrl-C during the next diagnosis.
bool press_ctrl_c = false;
// Recordings and effects at once of the last diagnosis.
size_t diagnosed_recordings = 0;
int diagnosed_effects = 0;

// Finds a wrong f-number, whatever the images are.
absl::StatusOr<v1::Diagnosis> FindFNumber(const RecordedSet& set, const DiagnosisSettings& settings,
                                          const DiagnosisProgress& progress) {
  diagnosed_recordings = set.frames.size();
  diagnosed_effects = settings.max_effects;
  v1::Diagnosis answer;
  if (press_ctrl_c) {
    raise(SIGINT);
    while (progress(0.5, "comparing")) absl::SleepFor(absl::Milliseconds(5));
    answer.set_set(set.description.name);
    answer.set_verdict("interrupted");
    answer.set_finding("Interrupted after 50 % of the comparison.");
    answer.add_ranked()->set_effect("optics.coma");
    return answer;
  }
  answer.set_set(set.description.name);
  answer.set_verdict("effect");
  answer.set_finding("The aperture is smaller than set.");
  answer.set_seed(static_cast<int64_t>(settings.seed));
  v1::Explanation* explanation = answer.add_ranked();
  explanation->set_effect("optics.f_number_error");
  explanation->set_stage("optics");
  explanation->set_probability(0.9);
  v1::FittedEffect* effect = explanation->add_effects();
  effect->set_effect("optics.f_number_error");
  effect->set_stage("optics");
  v1::FittedParameter* factor = effect->add_parameters();
  factor->set_name("f_number_factor");
  factor->set_value(1.25);
  factor->set_standard_error(0.02);
  v1::NextRecording* next = answer.add_next_recordings();
  next->set_description("f/2.8, 4 ms");
  next->set_expected_gain_bits(1.5);
  v1::Effect* calibrated = answer.add_calibrated_effects();
  calibrated->set_effect("optics.f_number_error");
  (*calibrated->mutable_parameters())["f_number_factor"] = 1.25;
  AddInspectionChanges({FindEffect("optics.f_number_error"), {1.25}}, set.description, &answer);
  RecordingSet description = set.description;
  description.laser.power_w *= 2;
  *answer.mutable_calibrated() = RecordingsToProto(description);
  return answer;
}

// Finds light between surfaces, whatever the images are.
absl::StatusOr<v1::Diagnosis> FindInterreflection(const RecordedScene& scene,
                                                  const SceneDiagnosisSettings&,
                                                  const SceneDiagnosisProgress&) {
  v1::Diagnosis answer;
  answer.set_set(scene.recordings.name);
  answer.set_verdict("effect");
  answer.set_finding("Light goes from surface to surface.");
  v1::Explanation* explanation = answer.add_ranked();
  explanation->set_effect("illumination.interreflection");
  explanation->set_stage("illumination");
  explanation->set_probability(0.99);
  v1::Effect* calibrated = answer.add_calibrated_effects();
  calibrated->set_effect("illumination.interreflection");
  (*calibrated->mutable_parameters())["interreflected_light_factor"] = 1;
  AddInterreflectionChanges(calibrated->effect(), /*laser_light=*/true, 1, &answer);
  v1::FittedDeviation* laser = answer.mutable_model_fit()->add_deviations();
  laser->set_name("laser_factor");
  laser->set_value(0.25);
  return answer;
}

absl::StatusOr<v1::Verification> OneNumber(const RecordedSet& set, const VerificationSettings&,
                                           const DiagnosisProgress&) {
  v1::Verification answer;
  answer.set_set(set.description.name);
  v1::RecordingVerification* recording = answer.add_recordings();
  recording->set_file(set.description.recordings[0].file);
  recording->set_f_number(16);
  v1::ChannelVerification* channel = recording->add_channels();
  channel->set_channel("mono");
  channel->set_e_i(0.125);
  return answer;
}

class DiagnoseCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    RenderServerOptions options;
    options.listen = "unix:" + folder_ + "/s";
    options.spool_folder = folder_;
    options.threads = 2;
    auto server = RenderServer::Start(options, {FindFNumber, OneNumber, FindInterreflection});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    RenderClientOptions client;
    client.address = server_->address();
    const auto files = RenderToFolder(client, PlateSpec(3), {}, folder_ + "/set");
    ASSERT_TRUE(files.ok()) << files.status();
  }
  void TearDown() override {
    server_.reset();
    fs::remove_all(folder_);
  }

  // `sightline ARGUMENTS --server OURS`.
  CommandResult Run(const std::string& command, std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--server", server_->address()});
    return RunCommand(command == "diagnose" ? AddDiagnoseCommand
                      : command == "render" ? AddRenderCommand
                                            : AddVerifyCommand,
                      arguments);
  }

  // Makes the set one of a part, a flat table of which the images are as good as any.
  void MakePart(const std::string& file, const std::string& digest) {
    const std::string description = folder_ + "/set/recordings.json";
    v1::Recordings message;
    ASSERT_TRUE(ReadRecordingsMessage(description, &message).ok());
    message.set_format_version(2);
    message.clear_surface();
    message.clear_rig();
    message.clear_uncertainty();
    v1::Recordings::RecordedPart* part = message.mutable_part();
    part->set_file(file);
    part->set_part_digest(digest);
    part->mutable_lens()->set_focal_length_m(0.016);
    part->mutable_lens()->set_f_number(16);
    part->mutable_laser()->set_power_w(0.004);
    v1::Material* material = part->add_materials()->mutable_material();
    material->set_name("grey");
    material->mutable_lambert()->set_diffuse_albedo(0.5);
    for (v1::Recording& recording : *message.mutable_recordings()) {
      recording.clear_plate_position_id();
      recording.mutable_measurement()->set_camera_distance_m(0.3);
      recording.mutable_measurement()->set_triangulation_angle_deg(30);
      recording.set_scan(1);
      recording.set_stage_position_m(0);
    }
    std::ofstream(description) << ToJson(message);
  }

  std::string folder_ = "/tmp/sightline-diagnose-XXXXXX";
  std::unique_ptr<RenderServer> server_;
};

TEST_F(DiagnoseCommandTest, WritesTheAnswerAndACalibratedDescription) {
  const CommandResult result = Run("diagnose", {folder_ + "/set"});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("The aperture is smaller than set."));
  EXPECT_THAT(result.output, HasSubstr("0.900  optics.f_number_error  f_number_factor 1.25"));
  EXPECT_THAT(result.output, HasSubstr("f/2.8, 4 ms (1.5 bits)"));
  const fs::path out = folder_ + "/set/diagnosis";
  const auto answer = nlohmann::json::parse(Bytes(out / "test.json"));
  EXPECT_EQ(answer["ranked"][0]["parameters"]["f_number_factor"], 1.25);
  EXPECT_EQ(Bytes(out / "diagnosis.json"), Bytes(out / "test.json"));
  v1::Diagnosis full;
  ASSERT_TRUE(ReadStrictJsonFile((out / "diagnosis_full.json").string(), &full).ok());
  EXPECT_EQ(full.finding(), "The aperture is smaller than set.");
  EXPECT_THAT(Bytes(out / "report.json"), HasSubstr("The aperture is smaller than set."));
  // The recorded plate itself as an inspection, which can be rendered as it is.
  const std::string inspection = (out / "calibrated/inspection.json").string();
  const auto plate = ReadInspection(inspection);
  ASSERT_TRUE(plate.ok()) << plate.status();
  EXPECT_DOUBLE_EQ(plate->rig.lens->f_number, 16 * 1.25);
  EXPECT_TRUE(fs::exists(plate->part_file));
  const CommandResult rendered = Run("render", {inspection, "--out", folder_ + "/plate"});
  EXPECT_EQ(rendered.exit_code, kExitDone) << rendered.errors;
  EXPECT_TRUE(fs::exists(folder_ + "/plate/images/000.png"));

  const auto calibrated = ReadRecordings((out / "calibrated/recordings.json").string());
  ASSERT_TRUE(calibrated.ok()) << calibrated.status();
  EXPECT_DOUBLE_EQ(calibrated->laser.power_w, 2 * 0.00058);
  // The renderer takes both files as they are.
  v1::RenderSpec spec;
  ASSERT_TRUE(
      ReadStrictJsonFile((out / "calibrated/effects.json").string(), spec.mutable_plate()).ok());
  EXPECT_EQ(spec.plate().effects(0).effect(), "optics.f_number_error");
  ASSERT_TRUE(ReadRecordingsMessage((out / "calibrated/recordings.json").string(),
                                    spec.mutable_plate()->mutable_recordings())
                  .ok());
  RenderClientOptions client;
  client.address = server_->address();
  EXPECT_TRUE(RenderToFolder(client, spec, {}, folder_ + "/again").ok());
}

TEST_F(DiagnoseCommandTest, CalibratedInspectionIsWrittenOnRequest) {
  std::ofstream(folder_ + "/table.obj") << kTable;
  const std::string inspection = folder_ + "/inspection.json";
  std::ofstream(inspection) << R"({"name": "table", "part": {"file": "table.obj", "unit": "m"},
    "lens": {"focal_length_m": 0.016, "f_number": 8}})";
  const std::string out = folder_ + "/out";
  CommandResult result =
      Run("diagnose", {folder_ + "/set/recordings.json", "--out", out, "--inspection", inspection});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  const auto read = ReadInspection(out + "/calibrated/inspection.json");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_DOUBLE_EQ(read->rig.lens->f_number, 10);
  EXPECT_TRUE(fs::exists(read->part_file));
  EXPECT_THAT(result.output, HasSubstr("lens.f_number 8 -> 10 (optics.f_number_error)"));
  const CommandResult rendered =
      Run("render", {out + "/calibrated/inspection.json", "--out", folder_ + "/table"});
  EXPECT_EQ(rendered.exit_code, kExitWrongInput);  // it has no sensor, as before
  EXPECT_THAT(rendered.errors, HasSubstr("camera.sensor_file is missing"));
  // One that belongs to an earlier diagnosis does not stay.
  result = Run("diagnose", {folder_ + "/set", "--out", out});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_EQ(ReadInspection(out + "/calibrated/inspection.json")->name, "test");
  // Mistakes show before the work.
  std::ofstream(inspection) << R"({"part": {"file": "table.obj", "unit": "m"},
    "lens": {"focal_length_m": 0.016, "f_number": -1}})";
  result = Run("diagnose", {folder_ + "/set", "--out", out, "--inspection", inspection});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("f_number"));
}

TEST_F(DiagnoseCommandTest, QuickTakesFewerRecordingsAndSaysSo) {
  CommandResult result = Run("diagnose", {folder_ + "/set", "--quick"});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_EQ(diagnosed_effects, 1);
  EXPECT_EQ(diagnosed_recordings, 3u);
  EXPECT_THAT(result.errors, HasSubstr("--quick: from 3 of 3 recordings, with at most 1 effect"));
  RenderClientOptions client;
  client.address = server_->address();
  const auto files = RenderToFolder(client, PlateSpec(43), {}, folder_ + "/long");
  ASSERT_TRUE(files.ok()) << files.status();
  result = Run("diagnose", {folder_ + "/long", "--quick", "--max-effects", "2"});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_LE(diagnosed_recordings, 16u);
  EXPECT_EQ(diagnosed_effects, 2);
  EXPECT_THAT(result.errors, HasSubstr(" of 43 recordings, with at most 2 effects at once"));
  EXPECT_THAT(Bytes(folder_ + "/long/diagnosis/report.json"), HasSubstr("of 43 recordings"));
}

// In a process of its own: what is interrupted stays so.
TEST_F(DiagnoseCommandTest, CtrlCKeepsWhatIsKnown) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto interrupted = [this] {
    press_ctrl_c = true;
    const fs::path out = folder_ + "/set/diagnosis";
    fs::create_directories(out / "calibrated");
    std::ofstream(out / "calibrated/inspection.json") << "of an earlier run";
    const CommandResult result = Run("diagnose", {folder_ + "/set"});
    const auto answer = nlohmann::json::parse(Bytes(out / "diagnosis.json"));
    const std::string report = Bytes(out / "report.json");
    const bool kept = answer["verdict"] == "interrupted" &&
                      answer["ranked"][0]["effect"] == "optics.coma" &&
                      report.find("Interrupted: this is no finding") != std::string::npos &&
                      !fs::exists(out / "calibrated") &&
                      result.errors.find("Ctrl-C again ends at once") != std::string::npos;
    std::fprintf(stderr, "%s\n", kept ? "all is kept" : result.errors.c_str());
    server_.reset();
    fs::remove_all(folder_);
    std::_Exit(result.exit_code);
  };
  EXPECT_EXIT(interrupted(), ::testing::ExitedWithCode(kExitInterrupted), "all is kept");
}

TEST_F(DiagnoseCommandTest, Verify) {
  const CommandResult result = Run("verify", {folder_ + "/set"});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  const fs::path out = folder_ + "/set/verification";
  v1::Verification full;
  ASSERT_TRUE(ReadStrictJsonFile((out / "verification.json").string(), &full).ok());
  EXPECT_EQ(full.recordings(0).channels(0).e_i(), 0.125);
  const std::vector<std::string> lines = absl::StrSplit(Bytes(out / "verification.csv"), '\n');
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[1], "0,images/0.png,mono,0,0,16,0,0,0.125,,,,,");
  const auto commas = [](const std::string& line) {
    return std::count(line.begin(), line.end(), ',');
  };
  EXPECT_EQ(commas(lines[0]), commas(lines[1]));
  EXPECT_TRUE(fs::exists(out / "report.html"));
  EXPECT_TRUE(fs::exists(out / "report.json"));
}

TEST_F(DiagnoseCommandTest, WrongInputIsNamed) {
  const std::string set = folder_ + "/set";
  EXPECT_EQ(Run("diagnose", {}).exit_code, kExitWrongInput);
  EXPECT_EQ(Run("diagnose", {set, "--max-effects", "4"}).exit_code, kExitWrongInput);
  for (const char* command : {"diagnose", "verify"}) {
    CommandResult result = Run(command, {folder_ + "/nothing"});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr(folder_ + "/nothing"));
    result = Run(command, {set, "--threads", "2"});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr("--threads"));
  }
  CommandResult result = Run("diagnose", {set, "--exclude", "sensor.smaer"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("sensor.smear"));

  // An image that is something else, then one that is not there.
  std::ofstream(set + "/images/1.png") << "no image";
  result = Run("diagnose", {set});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("recordings.json: recordings[1].file: images/1.png: "));
  fs::remove(set + "/images/1.png");
  for (const char* command : {"diagnose", "verify"}) {
    result = Run(command, {set});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr("1 of 3 images cannot be read: images/1.png"));
  }
  EXPECT_FALSE(fs::exists(set + "/diagnosis/diagnosis.json"));
}

TEST_F(DiagnoseCommandTest, Part) {
  ASSERT_NO_FATAL_FAILURE(MakePart("table.obj", ""));
  std::ofstream(folder_ + "/set/table.obj") << kTable;
  const CommandResult result = Run("diagnose", {folder_ + "/set", "--part-unit", "m"});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("Light goes from surface to surface."));
  EXPECT_THAT(result.output, HasSubstr("laser.power_w 0.004 -> 0.005 (laser_factor)"));
  const fs::path out = folder_ + "/set/diagnosis";
  const auto answer = nlohmann::json::parse(Bytes(out / "diagnosis.json"));
  EXPECT_EQ(answer["ranked"][0]["effect"], "illumination.interreflection");
  EXPECT_THAT(Bytes(out / "report.json"), HasSubstr("Light goes from surface to surface."));
  const std::string inspection = (out / "calibrated/inspection.json").string();
  const auto calibrated = ReadInspection(inspection);
  ASSERT_TRUE(calibrated.ok()) << calibrated.status();
  EXPECT_TRUE(calibrated->render.laser_interreflection);
  EXPECT_DOUBLE_EQ(calibrated->rig.laser.power_w, 0.005);
  EXPECT_TRUE(fs::equivalent(calibrated->part_file, folder_ + "/set/table.obj"));
  const CommandResult rendered = Run(
      "render", {inspection, "--out", folder_ + "/table", "--measurement", "0.3,30,0,0,0,0,0,0,0"});
  EXPECT_EQ(rendered.exit_code, kExitDone) << rendered.errors;
  // Rendering describes plates by recordings.json, parts by inspection.json.
  EXPECT_FALSE(fs::exists(out / "calibrated/recordings.json"));

  // The model can be that of an inspection.
  std::ofstream(folder_ + "/mine.json") << R"({"part": {"file": "set/table.obj", "unit": "m"},
    "camera": {"sensor": {)" << kPlateSpecSensor
                                        << R"(}}, "lens": {"focal_length_m": 0.016, "f_number": 8},
    "laser": {"power_w": 0.002}, "materials": [{"material": {"name": "paint",
      "lambert": {"diffuse_albedo": 0.7}}}]})";
  const CommandResult other =
      Run("diagnose", {folder_ + "/set", "--inspection", folder_ + "/mine.json"});
  ASSERT_EQ(other.exit_code, kExitDone) << other.errors;
  EXPECT_DOUBLE_EQ(ReadInspection(inspection)->rig.laser.power_w, 0.0025);
}

TEST_F(DiagnoseCommandTest, WhatIsWrongWithAPartIsNamed) {
  const std::string set = folder_ + "/set";
  CommandResult result = Run("diagnose", {set, "--part", folder_ + "/table.obj"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("--part is for recordings of a part"));

  ASSERT_NO_FATAL_FAILURE(MakePart("table.obj", "0123"));
  result = Run("verify", {set});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("recordings.json: format_version is 2 (images of a part)"));
  result = Run("diagnose", {set});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("part.unit is missing"));
  EXPECT_THAT(result.errors, HasSubstr("--part-unit"));
  result = Run("diagnose", {set, "--part-unit", "m"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr(set + "/table.obj: cannot be read"));
  EXPECT_THAT(result.errors, HasSubstr("--part"));

  const std::string part = folder_ + "/other.obj";
  std::ofstream(part) << kTable;
  result = Run("diagnose", {set, "--part", part, "--part-unit", "cm"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("another file or another unit"));
  EXPECT_THAT(result.errors, HasSubstr("2 x 2 x 0 mm"));
  result = Run("diagnose", {set, "--part", part, "--part-unit", "furlong"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("furlong"));
  result = Run("diagnose", {set, "--part", part, "--part-unit", "m", "--max-effects", "3"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("max_effects: is 3, must be in [1, 2]"));
  fs::remove(set + "/images/1.png");
  result = Run("diagnose", {set, "--part", part, "--part-unit", "m"});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("1 of 3 images cannot be read: images/1.png"));
  EXPECT_FALSE(fs::exists(set + "/diagnosis/diagnosis.json"));
}

}  // namespace
}  // namespace sightline
