// SPDX-License-Identifier: Apache-2.0
// Render worker and `sightline render` as processes of their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/recordings/recordings.h"
#include "planner_client/embedded_server/embedded_server.h"
#include "planner_client/render_client/render_client.h"
#include "render_worker/image_file/image_file.h"
#include "tests/integration/run_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kPlateSensor[] = R"({"sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
  "sensor_columns_px": 64, "sensor_rows_px": 48, "bit_depth_bit": 10,
  "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
  "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.57, "dark_noise_electrons": 6.5,
  "dark_current_electrons_per_s": 0})";

v1::Recordings PlateRecordings(int count) {
  v1::Recordings set;
  set.set_format("laser-line-recordings");
  set.set_format_version(1);
  set.set_set("test");
  v1::Sensor* camera = set.mutable_camera();
  camera->set_sensor_type("mono");
  camera->set_pixel_pitch_m(5.3e-6);
  camera->set_sensor_columns_px(64);
  camera->set_sensor_rows_px(48);
  camera->set_bit_depth_bit(10);
  camera->mutable_quantum_efficiency()->set_mono(0.53);
  camera->set_gain_dn_per_electron(0.16);
  camera->set_saturation_capacity_electrons(9893);
  camera->set_dark_mean_electrons(27.57);
  camera->set_dark_noise_electrons(6.5);
  camera->set_dark_current_electrons_per_s(0);
  set.mutable_lens()->set_focal_length_m(0.016);
  set.mutable_lens()->set_transmission(0.92);
  v1::Recordings::RecordedLaser* laser = set.mutable_laser();
  laser->set_wavelength_m(661e-9);
  laser->set_power_w(0.00058);
  laser->set_divergence_rad(0.00105);
  laser->set_beam_focus_distance_m(0.44);
  laser->set_fan_angle_deg(36.8);
  set.mutable_surface()->set_diffuse_albedo(0.35);
  set.mutable_surface()->set_specular_f0(0.66);
  set.mutable_surface()->set_ggx_alpha(0.43);
  set.mutable_rig()->set_incidence_angle_deg(45);
  for (int i = 0; i < count; ++i) {
    v1::Recording* recording = set.add_recordings();
    recording->set_file(absl::StrCat("images/", i, ".png"));
    recording->set_kind("laser");
    recording->set_timestamp_s(i);
    recording->set_plate_position_id(i);
    recording->set_same_speckle(false);
    recording->set_burst_frame_index(0);
    recording->set_exposure_time_s(0.002);
    recording->set_f_number(16);
    recording->set_camera_distance_m(0.331);
    recording->set_focus_distance_m(0.331);
    recording->set_laser_distance_m(0.416);
    recording->set_line_offset_m(0);
    recording->set_roi_column_px(-32);
    recording->set_roi_row_px(-24);
    recording->set_roi_columns_px(64);
    recording->set_roi_rows_px(48);
    recording->set_repeat_group(i);
  }
  return set;
}

class RenderProcessTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    std::ofstream(folder_ + "/table.obj")
        << "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";
    Write("inspection.json", absl::StrCat(R"({"name": "table",
      "part": {"file": "table.obj", "unit": "m"}, "camera": {"sensor": )",
                                          kPlateSensor,
                                          R"(}, "lens": {"focal_length_m": 0.016, "f_number": 16},
      "laser": {"power_w": 0.005, "fan_angle_deg": 40},
      "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.5}}}],
      "render": {"exposure_time_s": 0.005}})"));
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + "/" + name) << text;
    return folder_ + "/" + name;
  }

  // `sightline render ARGUMENTS --out FOLDER/out`; {folder} is replaced.
  ProcessResult Render(const std::string& arguments) const {
    const std::string command = absl::StrCat(
        BinFolder(), "/sightline render ", absl::StrReplaceAll(arguments, {{"{folder}", folder_}}),
        " --out ", folder_, "/out");
    return RunProcess(command);
  }

  static std::string Bytes(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

  // Everything under out/ that is not complete.
  std::vector<std::string> Partial() const {
    std::vector<std::string> partial;
    if (!fs::exists(folder_ + "/out")) return partial;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ + "/out")) {
      if (!entry.is_regular_file()) continue;
      const std::string bytes = Bytes(entry.path());
      const bool png = entry.path().extension() == ".png";
      if (!png ||
          !absl::StrContains(bytes.substr(bytes.size() < 12 ? 0 : bytes.size() - 12), "IEND")) {
        partial.push_back(entry.path());
      }
    }
    return partial;
  }

  std::string folder_ = "/tmp/sightline-render-XXXXXX";
};

TEST_F(RenderProcessTest, PartImageOfAFixedMeasurement) {
  const std::string measurement = " --measurement 0.3,30,0,0,0,0,0,0,0";
  const ProcessResult result = Render("{folder}/inspection.json --layers" + measurement);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto set = ReadRecordings(folder_ + "/out/recordings.json");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->recordings.size(), 1u);
  EXPECT_TRUE(fs::exists(folder_ + "/out/images/000_layers.exr"));
  const std::string image = Bytes(folder_ + "/out/images/000.png");
  // Another thread count, the same bytes; another seed, others.
  ASSERT_EQ(Render("{folder}/inspection.json --threads 1" + measurement).exit_code, 0);
  EXPECT_EQ(Bytes(folder_ + "/out/images/000.png"), image);
  ASSERT_EQ(Render("{folder}/inspection.json --seed 2" + measurement).exit_code, 0);
  EXPECT_NE(Bytes(folder_ + "/out/images/000.png"), image);
}

// The domain of a rigid head is part of its description: without it the housing is not known.
TEST_F(RenderProcessTest, ARigidHeadWithAFixedDistance) {
  std::ifstream file(folder_ + "/inspection.json");
  std::ostringstream text;
  text << file.rdbuf();
  std::string rigid = text.str();
  ASSERT_EQ(rigid.front(), '{');
  rigid.insert(1, R"("rig": {"sensor_mount": "SENSOR_MOUNT_RIGID"},
      "measurement": {"camera_distance_m": {"fixed": 0.3}, "triangulation_angle_deg": {"fixed": 30}},)");
  Write("rigid.json", rigid);
  const ProcessResult result = Render("{folder}/rigid.json --measurement 0.3,30,0,0,0,0,0,0,0");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_TRUE(fs::exists(folder_ + "/out/images/000.png"));
}

// A draft joins pixels and is called one; a crop is the middle of the sensor; a preview is beside
// every image and changes nothing of it.
TEST_F(RenderProcessTest, DraftsCropsAndPreviews) {
  const std::string command = "{folder}/inspection.json --measurement 0.3,30,0,0,0,0,0,0,0";
  ASSERT_EQ(Render(command).exit_code, 0);
  const std::string image = Bytes(folder_ + "/out/images/000.png");
  EXPECT_THAT(Bytes(folder_ + "/out/images/000_preview.png"), HasSubstr("not data"));
  fs::remove_all(folder_ + "/out");
  ASSERT_EQ(Render(command + " --no-previews").exit_code, 0);
  EXPECT_EQ(Bytes(folder_ + "/out/images/000.png"), image);
  EXPECT_FALSE(fs::exists(folder_ + "/out/images/000_preview.png"));

  const ProcessResult draft = Render(command + " --draft --draft-pixels 800");
  ASSERT_EQ(draft.exit_code, 0) << draft.output;
  EXPECT_THAT(draft.output, HasSubstr("2 x 2 pixels of the camera"));
  auto raw = ReadRawImage(folder_ + "/out/images/000.png");
  ASSERT_TRUE(raw.ok()) << raw.status();
  EXPECT_EQ(raw->columns_px, 32);
  EXPECT_EQ(raw->rows_px, 24);
  EXPECT_THAT(Bytes(folder_ + "/out/recordings.json"), HasSubstr("(draft)"));

  ASSERT_EQ(Render(command + " --crop 32x16").exit_code, 0);
  raw = ReadRawImage(folder_ + "/out/images/000.png");
  ASSERT_TRUE(raw.ok()) << raw.status();
  EXPECT_EQ(raw->columns_px, 32);
  EXPECT_EQ(raw->rows_px, 16);
  for (const char* crop : {"65x16", "32", "31x16", "8x8", "axb", "-32x16"}) {
    const ProcessResult result = Render(command + " --crop=" + crop);
    EXPECT_EQ(result.exit_code, 2) << crop;
    EXPECT_THAT(result.output, HasSubstr("64x48")) << crop;
  }
  Write("set.json", RecordingsToJson(PlateRecordings(1)));
  EXPECT_THAT(Render("{folder}/set.json --draft").output, HasSubstr("--draft is for parts"));
}

TEST_F(RenderProcessTest, ScansAndFramesOfAPlan) {
  Write("plan.json", R"({"scans": [
    {"index": 1, "measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30},
     "trigger_positions_m": [-0.01, 0, 0.01]},
    {"index": 2, "measurement": {"camera_distance_m": 0.35, "triangulation_angle_deg": -30},
     "trigger_positions_m": [0]}]})");
  const std::string plan = "{folder}/inspection.json --plan {folder}/plan.json";
  const ProcessResult all = Render(plan);
  ASSERT_EQ(all.exit_code, 0) << all.output;
  auto set = ReadRecordings(folder_ + "/out/recordings.json");
  ASSERT_TRUE(set.ok());
  ASSERT_EQ(set->recordings.size(), 4u);
  EXPECT_EQ(set->recordings[2].frame, 2);
  EXPECT_EQ(set->recordings[2].stage_position_m, 0.01);
  EXPECT_EQ(set->recordings[3].scan, 2);
  // One frame by itself is the same image.
  const auto image = ReadRawImage(folder_ + "/out/images/001.png");
  ASSERT_EQ(Render(plan + " --scan 1 --frame 1").exit_code, 0);
  const auto alone = ReadRawImage(folder_ + "/out/images/000.png");
  ASSERT_TRUE(image.ok() && alone.ok());
  EXPECT_EQ(*alone, *image);
  set = ReadRecordings(folder_ + "/out/recordings.json");
  ASSERT_EQ(set->recordings.size(), 1u);
  EXPECT_EQ(set->recordings[0].scan, 1);
  EXPECT_EQ(set->recordings[0].frame, 1);

  EXPECT_THAT(Render(plan + " --scan 3").output, HasSubstr("--scan 3: must be in [1, 2]"));
  EXPECT_THAT(Render(plan + " --scan 2 --frame 1").output,
              HasSubstr("--frame 1: must be in [0, 0]"));
  EXPECT_THAT(Render(plan + " --frame 1").output, HasSubstr("--frame needs --scan"));
  EXPECT_EQ(Render(plan + " --frame 1").exit_code, 2);
}

TEST_F(RenderProcessTest, PlateSetIsAValidSet) {
  Write("set.json", RecordingsToJson(PlateRecordings(3)));
  const ProcessResult result = Render("{folder}/set.json");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto set = ReadRecordings(folder_ + "/out/recordings.json");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->recordings.size(), 3u);
  EXPECT_EQ(RecordingsToJson(PlateRecordings(3)) + "\n", Bytes(folder_ + "/out/recordings.json"));
  for (const RecordedImage& image : set->recordings) {
    EXPECT_TRUE(fs::exists(folder_ + "/out/" + image.file));
  }
}

// As it is after the process was killed: some images are listed, one that is not is there too, one
// was damaged since.
TEST_F(RenderProcessTest, GoesOnWithTheImagesThatAreMissing) {
  v1::Recordings recordings = PlateRecordings(5);
  // The last one begins with what the one before has left in the sensor.
  recordings.mutable_recordings(4)->set_burst_frame_index(1);
  Write("set.json", RecordingsToJson(recordings));
  ASSERT_EQ(Render("{folder}/set.json --checkpoint {folder}/checkpoint").exit_code, 0);
  const auto image = [&](int number) {
    return absl::StrCat(folder_, "/out/images/", number, ".png");
  };
  std::vector<std::string> whole;
  for (int i = 0; i < 5; ++i) whole.push_back(Bytes(image(i)));
  std::istringstream list(Bytes(folder_ + "/checkpoint/finished_images"));
  std::string kept, line;
  for (int lines = 0; lines < 5 && std::getline(list, line); ++lines) kept += line + "\n";
  Write("checkpoint/finished_images", kept + R"({"image":4,"fi)");
  fs::remove(image(4));
  fs::remove(folder_ + "/out/recordings.json");
  std::ofstream(image(1)) << "damaged";
  const fs::file_time_type before = fs::file_time_type::clock::now() - std::chrono::hours(1);
  fs::last_write_time(image(0), before);
  fs::last_write_time(image(3), before);

  const ProcessResult again = Render("{folder}/set.json --checkpoint {folder}/checkpoint");
  ASSERT_EQ(again.exit_code, 0) << again.output;
  EXPECT_THAT(again.output,
              AllOf(HasSubstr("6 files"), ::testing::Not(HasSubstr("another build"))));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(Bytes(image(i)), whole[i]) << i;
  EXPECT_EQ(fs::last_write_time(image(0)), before);
  EXPECT_EQ(fs::last_write_time(image(3)), before);
  EXPECT_TRUE(fs::exists(folder_ + "/out/recordings.json"));

  // Images of another request are not reused.
  const ProcessResult other = Render("{folder}/set.json --seed 2 --checkpoint {folder}/checkpoint");
  ASSERT_EQ(other.exit_code, 0) << other.output;
  EXPECT_THAT(other.output, HasSubstr("finished_images: its images are of another request"));
  EXPECT_NE(Bytes(image(0)), whole[0]);
}

// Parts may run anywhere and in any order; who runs after them makes the description alone.
TEST_F(RenderProcessTest, PartsMakeTheBytesOfTheWhole) {
  Write("set.json", RecordingsToJson(PlateRecordings(5)));
  ASSERT_EQ(Render("{folder}/set.json").exit_code, 0);
  std::map<std::string, std::string> whole;
  const auto files = [&] {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ + "/out")) {
      if (entry.is_regular_file()) bytes[entry.path()] = Bytes(entry.path());
    }
    return bytes;
  };
  whole = files();
  ASSERT_EQ(whole.size(), 6u);
  fs::remove_all(folder_ + "/out");
  const std::string command = "{folder}/set.json --checkpoint {folder}/checkpoint";
  for (const char* part : {" --part 2/2", " --part 1/2"}) {
    const ProcessResult result = Render(command + part);
    ASSERT_EQ(result.exit_code, 0) << result.output;
    EXPECT_FALSE(fs::exists(folder_ + "/out/recordings.json"));
  }
  EXPECT_EQ(files().size(), 5u);
  const auto made = fs::last_write_time(folder_ + "/out/images/0.png");
  // One that was killed here, before it had finished a file.
  Write("out/images/3.png.part-node-17", "half");
  const ProcessResult result = Render(command);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(files(), whole);
  EXPECT_EQ(fs::last_write_time(folder_ + "/out/images/0.png"), made);
  for (const char* part : {"0/2", "3/2", "1", "a/b", "1/2/3"}) {
    EXPECT_EQ(Render(command + " --part " + part).exit_code, 2) << part;
  }
  EXPECT_EQ(Render("{folder}/set.json --part 1/2").exit_code, 2);
}

TEST_F(RenderProcessTest, ProgramsGetProgressAndErrorsAsJson) {
  Write("set.json", RecordingsToJson(PlateRecordings(1)));
  const ProcessResult good =
      RunProcess(absl::StrCat(BinFolder(), "/sightline --progress=json render ", folder_,
                              "/set.json --out ", folder_, "/out"));
  EXPECT_EQ(good.exit_code, 0) << good.output;
  EXPECT_THAT(good.output, HasSubstr(R"({"message":"image 1 of 1","progress":)"));
  const ProcessResult bad =
      RunProcess(absl::StrCat(BinFolder(), "/sightline --progress=json render ", folder_,
                              "/no.json --out ", folder_, "/out"));
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_THAT(bad.output, AllOf(HasSubstr(R"({"error":{"code":"NOT_FOUND","message":")"),
                                HasSubstr("no.json"), HasSubstr(R"("reason":)")));
}

TEST_F(RenderProcessTest, WrongInputSaysWhatToGive) {
  ProcessResult result = Render("{folder}/inspection.json");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("does not fix camera_distance_m"), HasSubstr("--plan")));
  result = Render("{folder}/none.json");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("none.json"));
  result =
      Render("{folder}/inspection.json --measurement 0.3,30,0,0,0,0,0,0,0 --max-image-bytes 10KB");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("64 x 48 px"), HasSubstr("--max-image-bytes")));
  EXPECT_FALSE(fs::exists(folder_ + "/out/recordings.json"));
}

TEST_F(RenderProcessTest, KilledWorkerIsToldAndNothingIsHalfWritten) {
  EmbeddedServerOptions embedded;
  embedded.program = "render_worker";
  embedded.description = "render worker";
  embedded.binary = BinFolder() + "/render_worker";
  embedded.arguments = {"--spool", "{folder}"};
  auto worker = EmbeddedServer::Start(embedded);
  ASSERT_TRUE(worker.ok()) << worker.status();
  const std::string spool = (*worker)->folder();
  EXPECT_TRUE(fs::exists(spool));
  RenderClientOptions options;
  options.embedded = worker->get();
  v1::RenderSpec spec;
  *spec.mutable_plate()->mutable_recordings() = PlateRecordings(2000);
  // Killed once the first image is there, whatever it does then.
  std::jthread killer([&](const std::stop_token& stop) {
    while (!stop.stop_requested() && !fs::exists(folder_ + "/out/images/0.png")) {
      absl::SleepFor(absl::Milliseconds(2));
    }
    const int pid = (*worker)->pid();
    if (pid > 1) kill(pid, SIGKILL);
  });
  const auto files = RenderToFolder(options, spec, {}, folder_ + "/out");
  killer.request_stop();
  killer.join();
  EXPECT_TRUE(absl::IsUnavailable(files.status())) << files.status();
  EXPECT_THAT(std::string(files.status().message()),
              HasSubstr("the render worker that was started for this run was killed by signal 9"));
  EXPECT_FALSE(fs::exists(folder_ + "/out/recordings.json"));
  EXPECT_THAT(Partial(), ::testing::IsEmpty());
  worker->reset();
  EXPECT_FALSE(fs::exists(spool));
}

TEST_F(RenderProcessTest, InterruptKeepsWhatIsFinished) {
  EmbeddedServerOptions embedded;
  embedded.program = "render_worker";
  embedded.description = "render worker";
  embedded.binary = BinFolder() + "/render_worker";
  embedded.arguments = {"--spool", "{folder}"};
  auto worker = EmbeddedServer::Start(embedded);
  ASSERT_TRUE(worker.ok()) << worker.status();
  std::atomic<bool> interrupted = false;
  RenderClientOptions options;
  options.embedded = worker->get();
  options.interrupted = &interrupted;
  v1::RenderSpec spec;
  *spec.mutable_plate()->mutable_recordings() = PlateRecordings(2000);
  std::jthread interrupter([&](const std::stop_token& stop) {
    while (!stop.stop_requested() && !fs::exists(folder_ + "/out/images/0.png")) {
      absl::SleepFor(absl::Milliseconds(2));
    }
    interrupted = true;
  });
  const auto files = RenderToFolder(options, spec, {}, folder_ + "/out");
  interrupter.request_stop();
  interrupter.join();
  EXPECT_TRUE(absl::IsCancelled(files.status())) << files.status();
  EXPECT_TRUE(fs::exists(folder_ + "/out/images/0.png"));
  EXPECT_FALSE(fs::exists(folder_ + "/out/recordings.json"));
  EXPECT_THAT(Partial(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace sightline
