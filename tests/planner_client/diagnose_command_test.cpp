// `sightline diagnose` and `sightline verify` with a worker in this process whose findings are
// injected.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"
#include "planner_client/render_client/render_client.h"
#include "render_worker/service/render_server.h"
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

// Finds a wrong f-number, whatever the images are.
absl::StatusOr<v1::Diagnosis> FindFNumber(const RecordedSet& set, const DiagnosisSettings& settings,
                                          const DiagnosisProgress&) {
  v1::Diagnosis answer;
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
  RecordingSet description = set.description;
  description.laser.power_w *= 2;
  *answer.mutable_calibrated() = RecordingsToProto(description);
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
    auto server = RenderServer::Start(options, {FindFNumber, OneNumber});
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

  struct Result {
    int exit_code;
    std::string output, errors;
  };
  // `sightline ARGUMENTS --server OURS`.
  Result Run(const std::string& command, const std::vector<std::string>& arguments) {
    CLI::App app;
    const Command run = command == "diagnose" ? AddDiagnoseCommand(app) : AddVerifyCommand(app);
    std::vector<std::string> reversed = {server_->address(), "--server"};
    reversed.insert(reversed.end(), arguments.rbegin(), arguments.rend());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    int exit_code = kExitWrongInput;
    try {
      app.parse(reversed);
      exit_code = run();
    } catch (const CLI::ParseError& error) {
      exit_code = app.exit(error) == 0 ? kExitDone : kExitWrongInput;
    }
    std::string output = testing::internal::GetCapturedStdout();
    return {exit_code, std::move(output), testing::internal::GetCapturedStderr()};
  }

  std::string folder_ = "/tmp/sightline-diagnose-XXXXXX";
  std::unique_ptr<RenderServer> server_;
};

TEST_F(DiagnoseCommandTest, WritesTheAnswerAndACalibratedDescription) {
  const Result result = Run("diagnose", {folder_ + "/set"});
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
  EXPECT_THAT(Bytes(out / "report.html"), HasSubstr("The aperture is smaller than set."));
  EXPECT_FALSE(fs::exists(out / "calibrated/inspection.json"));

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
  std::ofstream(folder_ + "/table.obj")
      << "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";
  const std::string inspection = folder_ + "/inspection.json";
  std::ofstream(inspection) << R"({"name": "table", "part": {"file": "table.obj", "unit": "m"},
    "lens": {"focal_length_m": 0.016, "f_number": 8}})";
  const std::string out = folder_ + "/out";
  Result result =
      Run("diagnose", {folder_ + "/set/recordings.json", "--out", out, "--inspection", inspection});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  const auto read = ReadInspection(out + "/calibrated/inspection.json");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_DOUBLE_EQ(read->rig.lens->f_number, 10);
  EXPECT_TRUE(fs::exists(read->part_file));
  EXPECT_THAT(result.output, HasSubstr("lens.f_number 8 -> 10 (optics.f_number_error)"));
  // One that belongs to an earlier diagnosis does not stay.
  result = Run("diagnose", {folder_ + "/set", "--out", out});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_FALSE(fs::exists(out + "/calibrated/inspection.json"));
  // Mistakes show before the work.
  std::ofstream(inspection) << R"({"part": {"file": "table.obj", "unit": "m"},
    "lens": {"focal_length_m": 0.016, "f_number": -1}})";
  result = Run("diagnose", {folder_ + "/set", "--out", out, "--inspection", inspection});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("f_number"));
}

TEST_F(DiagnoseCommandTest, Verify) {
  const Result result = Run("verify", {folder_ + "/set"});
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
}

TEST_F(DiagnoseCommandTest, WrongInputIsNamed) {
  const std::string set = folder_ + "/set";
  EXPECT_EQ(Run("diagnose", {}).exit_code, kExitWrongInput);
  EXPECT_EQ(Run("diagnose", {set, "--max-effects", "4"}).exit_code, kExitWrongInput);
  for (const char* command : {"diagnose", "verify"}) {
    Result result = Run(command, {folder_ + "/nothing"});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr(folder_ + "/nothing"));
    result = Run(command, {set, "--threads", "2"});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr("--threads"));
  }
  Result result = Run("diagnose", {set, "--exclude", "sensor.smaer"});
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

TEST_F(DiagnoseCommandTest, PartsAreRefused) {
  v1::Recordings message;
  const std::string file = folder_ + "/set/recordings.json";
  ASSERT_TRUE(ReadRecordingsMessage(file, &message).ok());
  message.set_format_version(2);
  message.clear_surface();
  message.clear_rig();
  message.clear_uncertainty();
  message.mutable_part()->set_file("head.glb");
  message.mutable_part()->mutable_lens()->set_focal_length_m(0.016);
  message.mutable_part()->mutable_lens()->set_f_number(16);
  for (v1::Recording& recording : *message.mutable_recordings()) {
    recording.clear_plate_position_id();
    recording.mutable_measurement()->set_camera_distance_m(0.3);
    recording.set_scan(1);
    recording.set_stage_position_m(0);
  }
  std::ofstream(file) << ToJson(message);
  for (const char* command : {"diagnose", "verify"}) {
    const Result result = Run(command, {folder_ + "/set"});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr(file + ": format_version is 2 (images of a part)"));
  }
}

}  // namespace
}  // namespace sightline
