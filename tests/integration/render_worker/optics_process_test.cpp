// SPDX-License-Identifier: Apache-2.0
// `sightline optics` as a process of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/json/strict_json.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/optics.pb.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/run_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kOpticsSensor[] =
    R"({"name": "small", "sensor_type": "mono", "pixel_pitch_m": 5.3e-6,
  "sensor_columns_px": 128, "sensor_rows_px": 64, "bit_depth_bit": 10,
  "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
  "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.57, "dark_noise_electrons": 6.5,
  "dark_current_electrons_per_s": 0, "mount": "C"})";

class OpticsProcessTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    Write("table.obj",
          "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n");
    Write("inspection.json", Inspection(R"("f_numbers": [4, 16], "realisations": 2)"));
  }
  void TearDown() override { fs::remove_all(folder_); }

  static std::string Inspection(const std::string& optics, const std::string& more = "",
                                const std::string& lens = "") {
    return absl::StrCat(R"({"name": "table", "part": {"file": "table.obj", "unit": "m"},
      "camera": {"sensor": )",
                        kOpticsSensor, R"(}, "lens": {"focal_length_m": 0.016, "f_number": 8)",
                        lens,
                        R"(}, "laser": {"power_w": 0.005, "fan_angle_deg": 40},
      "measurement": {"camera_distance_m": {"fixed": 0.3}, "triangulation_angle_deg": {"fixed": 30},
        "camera_azimuth_deg": {"fixed": 0}, "camera_polar_deg": {"fixed": 0},
        "part_alpha_deg": {"fixed": 0}, "part_beta_deg": {"fixed": 0},
        "part_gamma_deg": {"fixed": 0}, "offset_y_m": {"fixed": 0}, "offset_z_m": {"fixed": 0}},
      "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.5}}}],
      "optics": {)",
                        optics, "}", more, "}");
  }

  std::string Write(const std::string& name, const std::string& text) {
    fs::create_directories((fs::path(folder_) / name).parent_path());
    std::ofstream(folder_ + "/" + name) << text;
    return folder_ + "/" + name;
  }

  // `sightline ARGUMENTS`; {folder} is replaced.
  ProcessResult Run(const std::string& arguments) const {
    const std::string command = absl::StrCat(
        BinFolder(), "/sightline ", absl::StrReplaceAll(arguments, {{"{folder}", folder_}}));
    return RunProcess(command);
  }

  template <typename Message>
  Message Read(const std::string& name) const {
    Message message;
    const absl::Status status = ReadStrictJsonFile(folder_ + "/" + name, &message);
    EXPECT_TRUE(status.ok()) << status;
    return message;
  }

  std::string folder_ = "/tmp/sightline-optics-XXXXXX";
};

TEST_F(OpticsProcessTest, OneFrame) {
  const ProcessResult result = Run("optics {folder}/inspection.json --out {folder}/out");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("has the least cost"));
  const auto optics = Read<v1::OpticsPlan>("out/optics.json");
  EXPECT_EQ(optics.curve_size(), 2);
  EXPECT_GT(optics.best().profile_coverage(), 0.9);
  EXPECT_LE(optics.best().u_px_interval().lower(), optics.best().u_px());
  EXPECT_TRUE(fs::exists(folder_ + "/out/report.html"));
  EXPECT_TRUE(fs::exists(folder_ + "/out/report.json"));
  EXPECT_FALSE(fs::exists(folder_ + "/out/plan.json"));
}

constexpr char kOpticsPlan[] = R"({"inspection_name": "table", "scans": [
  {"index": 1, "measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30},
   "trigger_positions_m": [-0.002, -0.001, 0, 0.001, 0.002]},
  {"index": 2, "measurement": {"camera_distance_m": 0.35, "triangulation_angle_deg": -30},
   "trigger_positions_m": [0, 0.001]}]})";

// The plan comes back with the setting of every scan, and images are made with it.
TEST_F(OpticsProcessTest, PlanGetsItsSettings) {
  Write("plan.json", kOpticsPlan);
  const ProcessResult result =
      Run("optics {folder}/inspection.json --plan {folder}/plan.json --out {folder}/out");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto optics = Read<v1::OpticsPlan>("out/optics.json");
  ASSERT_EQ(optics.scans_size(), 2);
  const auto plan = Read<v1::Plan>("out/plan.json");
  ASSERT_EQ(plan.scans_size(), 2);
  for (int s = 0; s < 2; ++s) {
    EXPECT_EQ(plan.scans(s).setting().f_number(), optics.scans(s).best().f_number());
    EXPECT_EQ(plan.scans(s).setting().exposure_time_s(), optics.scans(s).best().exposure_time_s());
    EXPECT_EQ(plan.scans(s).trigger_positions_m_size(), s == 0 ? 5 : 2);
  }
  const ProcessResult images =
      Run("render {folder}/inspection.json --plan {folder}/out/plan.json --scan 2 --frame 1 "
          "--out {folder}/images");
  ASSERT_EQ(images.exit_code, 0) << images.output;
  std::ostringstream text;
  text << std::ifstream(folder_ + "/images/recordings.json").rdbuf();
  EXPECT_THAT(text.str(),
              HasSubstr(absl::StrCat("\"f_number\": ", optics.scans(1).best().f_number())));
  const ProcessResult common = Run(
      "optics {folder}/inspection.json --plan {folder}/plan.json --common --out {folder}/common");
  ASSERT_EQ(common.exit_code, 0) << common.output;
  const auto same = Read<v1::Plan>("common/plan.json");
  EXPECT_EQ(same.scans(0).setting().exposure_time_s(), same.scans(1).setting().exposure_time_s());
}

TEST_F(OpticsProcessTest, SameSeedSameBytes) {
  for (const char* out : {"a", "b"}) {
    ASSERT_EQ(Run(absl::StrCat("optics {folder}/inspection.json --seed 5 --threads ",
                               out[0] == 'a' ? 1 : 2, " --out {folder}/", out))
                  .exit_code,
              0);
  }
  const auto bytes = [&](const char* file) {
    std::ostringstream text;
    text << std::ifstream(folder_ + "/" + file).rdbuf();
    return text.str();
  };
  EXPECT_EQ(bytes("a/optics.json"), bytes("b/optics.json"));
  EXPECT_EQ(bytes("a/report.html"), bytes("b/report.html"));
  EXPECT_EQ(bytes("a/report.json"), bytes("b/report.json"));
}

struct BadInput {
  const char* what;
  const char* optics;
  const char* more;
  const char* lens;
  const char* expected;
};
class OpticsBadInput : public OpticsProcessTest, public ::testing::WithParamInterface<BadInput> {};
TEST_P(OpticsBadInput, NamesFileFieldAndRange) {
  const BadInput& bad = GetParam();
  Write("bad.json", Inspection(bad.optics, bad.more, bad.lens));
  const ProcessResult result = Run("optics {folder}/bad.json --out {folder}/out");
  EXPECT_EQ(result.exit_code, 2) << bad.what << "\n" << result.output;
  EXPECT_THAT(result.output, AllOf(HasSubstr("bad.json"), HasSubstr(bad.expected))) << bad.what;
  EXPECT_FALSE(fs::exists(folder_ + "/out/optics.json"));
}
INSTANTIATE_TEST_SUITE_P(
    Cases, OpticsBadInput,
    ::testing::Values(
        BadInput{"f-number outside the lens's range", R"("f_numbers": [2, 22])", "",
                 R"(, "min_f_number": 1.4, "max_f_number": 16)",
                 "optics.f_numbers[1] is 22, must be in [1.4, 16]"},
        BadInput{"lens that cannot focus there", R"("focus_distance_m": {"fixed": 0.2})", "",
                 R"(, "min_focus_distance_m": 0.25)",
                 "optics.focus_distance_m.fixed is 0.2, must be in [0.25, 1000] m"},
        BadInput{"exposure longer than the frame time",
                 R"("f_numbers": [4], "max_motion_blur_px": 100,
                    "exposure_time_s": {"min": 0.05, "max": 0.1})",
                 R"(, "costs": {"frame_rate_hz": 50})", "",
                 "optics.exposure_time_s: the shortest, 0.05 s at f/4, is longer than 0.02 s"}));

TEST_F(OpticsProcessTest, OtherBadInput) {
  std::string text = Inspection("");
  Write("no_pitch.json", absl::StrReplaceAll(text, {{"\"pixel_pitch_m\": 5.3e-6,", ""}}));
  ProcessResult result = Run("optics {folder}/no_pitch.json --out {folder}/out");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("no_pitch.json"), HasSubstr("pixel_pitch_m")));
  fs::create_directories(folder_ + "/empty");
  result = Run("optics {folder}/inspection.json --catalogue {folder}/empty --out {folder}/out");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("empty"), HasSubstr("cameras")));
  result = Run("optics {folder}/inspection.json --catalogue {folder}/none --out {folder}/out");
  EXPECT_EQ(result.exit_code, 2);
  result =
      Run("optics {folder}/inspection.json --verification {folder}/none.json --out {folder}/o");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("none.json"));
  // Nothing to see.
  result = Run("optics {folder}/inspection.json --stage-position 0.5 --out {folder}/out");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("the laser lights nothing"));
}

// Two lenses: the one that sees too little loses by its field of view, and says so.
TEST_F(OpticsProcessTest, CatalogueChoosesAndSaysWhy) {
  Write("devices/cameras/small.json", kOpticsSensor);
  for (const auto& [name, focal] : {std::pair("wide", "0.016"), std::pair("long", "0.05")}) {
    Write(absl::StrCat("devices/lenses/", name, ".json"),
          absl::StrCat(R"({"name": ")", name, R"(", "mount": "C", "focal_length_m": )", focal,
                       R"(, "min_f_number": 4, "max_f_number": 8, "min_focus_distance_m": 0.1,
                         "image_circle_m": 0.011, "source": "test"})"));
  }
  Write("devices/lasers/red.json",
        R"({"name": "red", "laser": {"wavelength_m": 660e-9, "power_w": 0.005, "fan_angle_deg": 40,
            "divergence_rad": 0.001, "beam_focus_distance_m": 0.3}, "source": "test"})");
  const ProcessResult result =
      Run("optics {folder}/inspection.json --catalogue {folder}/devices --out {folder}/out");
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto devices = Read<v1::DeviceChoice>("out/devices.json");
  ASSERT_EQ(devices.combinations_size(), 2);
  EXPECT_TRUE(devices.combinations(0).chosen());
  EXPECT_EQ(devices.combinations(0).lens(), "wide");
  EXPECT_GT(devices.combinations(0).u_height_m(), 0);
  EXPECT_EQ(devices.combinations(1).lens(), "long");
  EXPECT_THAT(devices.combinations(1).lost_because(), HasSubstr("the camera sees"));
}

}  // namespace
}  // namespace sightline
