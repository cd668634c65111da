// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/recordings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <sstream>

#include "core/json/strict_json.h"
#include "core/recordings/assumed_values.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

v1::Recordings Plate() {
  v1::Recordings m;
  const absl::Status status = ParseStrictJson(R"({
    "format": "laser-line-recordings", "format_version": 1, "set": "test",
    "camera": {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6, "sensor_columns_px": 1280,
      "sensor_rows_px": 1024, "bit_depth_bit": 10, "quantum_efficiency": {"mono": 0.53},
      "gain_dn_per_electron": 0.16, "saturation_capacity_electrons": 9893,
      "dark_mean_electrons": 27.57, "dark_noise_electrons": 6.5, "dark_current_electrons_per_s": 0},
    "lens": {"focal_length_m": 0.016, "transmission": 0.92},
    "laser": {"wavelength_m": 6.61e-7, "power_w": 0.00058, "divergence_rad": 0.00105,
      "beam_focus_distance_m": 0.44, "fan_angle_deg": 36.8},
    "surface": {"diffuse_albedo": 0.35, "specular_f0": 0.66, "ggx_alpha": 0.43},
    "rig": {"incidence_angle_deg": 45},
    "uncertainty": {"camera_distance_m": 0.002, "incidence_angle_deg": 0.3},
    "recordings": [
      {"file": "images/000.png", "kind": "laser", "timestamp_s": 50, "series": "aperture",
       "plate_position_id": 1, "same_speckle": false, "burst_frame_index": 0,
       "exposure_time_s": 0.004, "f_number": 8, "camera_distance_m": 0.331,
       "focus_distance_m": 0.331, "laser_distance_m": 0.416, "line_offset_m": 0,
       "roi_column_px": -192, "roi_row_px": -128, "roi_columns_px": 384, "roi_rows_px": 256,
       "repeat_group": 0},
      {"file": "images/001.png", "kind": "dark", "timestamp_s": 60, "series": "dark",
       "same_speckle": false, "burst_frame_index": 1, "exposure_time_s": 0.004, "f_number": 8,
       "camera_distance_m": 0.331, "focus_distance_m": 0.331, "laser_distance_m": 0.416,
       "line_offset_m": 0, "roi_column_px": -192, "roi_row_px": -128, "roi_columns_px": 384,
       "roi_rows_px": 256, "repeat_group": 1}]})",
                                              "recordings.json", &m);
  EXPECT_TRUE(status.ok()) << status;
  return m;
}

TEST(Recordings, ValuesArriveInRadians) {
  const auto set = ParseRecordings(Plate(), "recordings.json");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->format_version, 1);
  EXPECT_NEAR(set->incidence_angle_rad, std::numbers::pi / 4, 1e-15);
  EXPECT_NEAR(set->uncertainty.incidence_angle_rad, 0.3 * std::numbers::pi / 180, 1e-15);
  ASSERT_EQ(set->recordings.size(), 2u);
  EXPECT_EQ(set->recordings[0].plate_position_id, 1);
  EXPECT_FALSE(set->recordings[1].plate_position_id);
  EXPECT_EQ(set->recordings[1].kind, RecordingKind::kDark);
}

TEST(Recordings, DarkFramesHaveNullForAPositionInTheFile) {
  const std::string json = RecordingsToJson(Plate());
  EXPECT_THAT(json, HasSubstr("\"plate_position_id\": null"));
  EXPECT_THAT(json, HasSubstr("\"plate_position_id\": 1,"));
  const std::string path = testing::TempDir() + "/null_position.json";
  std::ofstream(path) << json;
  const auto set = ReadRecordings(path);
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_FALSE(set->recordings[1].plate_position_id);
  std::filesystem::remove(path);
}

TEST(Recordings, ErrorsNameFileFieldValueAndRange) {
  using Change = std::function<void(v1::Recordings*)>;
  const struct {
    Change change;
    std::string expected;
  } cases[] = {
      {[](auto* m) { m->set_format("laser"); }, "format is \"laser\", must be"},
      {[](auto* m) { m->set_format_version(4); }, "format_version is 4, must be 1"},
      {[](auto* m) { m->clear_camera(); }, "camera is missing"},
      {[](auto* m) { m->mutable_camera()->set_gain_dn_per_electron(0); },
       "camera: gain_dn_per_electron is 0"},
      {[](auto* m) { m->mutable_lens()->clear_transmission(); }, "lens.transmission is missing"},
      {[](auto* m) { m->mutable_lens()->set_transmission(1.2); },
       "lens.transmission is 1.2, must be in (0, 1]"},
      {[](auto* m) { m->mutable_laser()->clear_power_w(); }, "laser.power_w is missing"},
      {[](auto* m) { m->mutable_surface()->clear_ggx_alpha(); }, "surface.ggx_alpha is missing"},
      {[](auto* m) { m->clear_rig(); }, "rig.incidence_angle_deg is missing"},
      {[](auto* m) { m->mutable_uncertainty()->set_gain_relative(-0.1); },
       "uncertainty.gain_relative is -0.1"},
      {[](auto* m) { m->clear_recordings(); }, "recordings is empty"},
      {[](auto* m) { m->mutable_recordings(0)->set_file("../x.png"); },
       "recordings[0].file is \"../x.png\", must stay in the set's folder"},
      {[](auto* m) { m->mutable_recordings(1)->set_file("images/000.png"); },
       "recordings[1].file is \"images/000.png\" like that of another"},
      {[](auto* m) { m->mutable_recordings(0)->set_kind("lasr"); },
       "recordings[0].kind is \"lasr\", must be laser, dark or ambient"},
      {[](auto* m) { m->mutable_recordings(0)->clear_plate_position_id(); },
       "recordings[0].plate_position_id is missing"},
      {[](auto* m) { m->mutable_recordings(0)->clear_exposure_time_s(); },
       "recordings[0].exposure_time_s is missing"},
      {[](auto* m) { m->mutable_recordings(0)->set_roi_column_px(-640 + 1000); },
       "recordings[0].roi_column_px and the other three"},
      {[](auto* m) { m->mutable_recordings(0)->set_focus_distance_m(0.016); },
       "recordings[0].focus_distance_m is 0.016, must be above"},
      {[](auto* m) { m->mutable_recordings(1)->set_timestamp_s(1); },
       "recordings[1].timestamp_s is 1, before"},
      {[](auto* m) { m->mutable_recordings(1)->set_burst_frame_index(2); },
       "recordings[1].burst_frame_index is 2, must follow"},
      {[](auto* m) { m->mutable_part()->set_file("a.glb"); }, "part belongs to format_version 2"},
  };
  for (const auto& c : cases) {
    v1::Recordings message = Plate();
    c.change(&message);
    const auto set = ParseRecordings(message, "r.json");
    EXPECT_EQ(set.status().code(), absl::StatusCode::kInvalidArgument) << c.expected;
    EXPECT_THAT(std::string(set.status().message()), HasSubstr("r.json: " + c.expected));
  }
}

TEST(Recordings, UnknownFieldsAreNamed) {
  const std::string path = testing::TempDir() + "/unknown_field.json";
  std::ofstream(path) << R"({"format": "laser-line-recordings", "cammera": {}})";
  const auto set = ReadRecordings(path);
  EXPECT_THAT(std::string(set.status().message()),
              AllOf(HasSubstr("cammera"), HasSubstr("\"camera\"")));
  std::filesystem::remove(path);
  EXPECT_EQ(ReadRecordings(path).status().code(), absl::StatusCode::kNotFound);
}

TEST(Recordings, PartSetsComeBackAsTheyAre) {
  RecordingSet set = *ParseRecordings(Plate(), "");
  set.format_version = 2;
  set.part = RecordedPart{"head.glb", "abc", Lens{}, Laser{}, {}, {}};
  set.recordings.resize(1);
  set.recordings[0].scan = 3;
  set.recordings[0].frame = 120;
  set.recordings[0].stage_position_m = -0.0125;
  set.recordings[0].measurement = {0.35, 0.5, 1, 0.2, 0.1, 0.3, 2, 0.01, -0.02};
  const auto back = ParseRecordings(RecordingsToProto(set), "");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->recordings[0].scan, 3);
  EXPECT_EQ(back->recordings[0].frame, 120);
  EXPECT_EQ(back->recordings[0].stage_position_m, -0.0125);
  EXPECT_EQ(back->recordings[0].measurement.camera_distance_m, 0.35);
  EXPECT_NEAR(back->recordings[0].measurement.part_gamma_rad, 2, 1e-12);
  EXPECT_EQ(back->part->file, "head.glb");
}

// The example's set and, where they lie beside the tree, sets that others made.
std::vector<std::filesystem::path> WholeSets() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  const std::filesystem::path tree = source != nullptr ? source : ".";
  std::vector<std::filesystem::path> sets = {tree / "examples/flat_plate/recordings.json"};
  const std::filesystem::path shared = tree / "../shared/recordings/open";
  if (!std::filesystem::exists(shared)) return sets;
  for (const auto& folder : std::filesystem::directory_iterator(shared)) {
    const std::filesystem::path set = folder.path() / "recordings.json";
    if (std::filesystem::exists(set)) sets.push_back(set);
  }
  return sets;
}

// Read, and written with the same content: field for field.
TEST(Recordings, WholeSetsRoundTrip) {
  for (const std::filesystem::path& path : WholeSets()) {
    v1::Recordings original;
    ASSERT_TRUE(ReadRecordingsMessage(path, &original).ok()) << path;
    const auto set = ParseRecordings(original, path);
    ASSERT_TRUE(set.ok()) << set.status();
    EXPECT_FALSE(set->recordings.empty()) << path;
    const v1::Recordings back = RecordingsToProto(*set);
    EXPECT_EQ(RecordingsToJson(back), RecordingsToJson(original)) << path;
  }
}

TEST(NumberNullPlatePositions, ReplacesMembersThatAreNullOnly) {
  EXPECT_EQ(NumberNullPlatePositions(R"({"plate_position_id" :
 null, "a": "\"plate_position_id\": null", "plate_position_id": 3, "b": null})"),
            R"({"plate_position_id" :
 -2147483648, "a": "\"plate_position_id\": null", "plate_position_id": 3, "b": null})");
  // No end in sight is no reason to fall over.
  const std::string open = "\"plate_position_id\"" + std::string(8 << 20, ' ');
  EXPECT_EQ(NumberNullPlatePositions(open), open);
  EXPECT_EQ(NumberNullPlatePositions("\"plate_position_id\":"), "\"plate_position_id\":");
}

TEST(AssumedValues, CompleteDescriptionStaysAsItIs) {
  v1::Recordings message = Plate();
  const std::string before = message.SerializeAsString();
  EXPECT_THAT(AssumeMissingValues(&message), ::testing::IsEmpty());
  EXPECT_EQ(message.SerializeAsString(), before);
}

TEST(AssumedValues, EveryValueThatCanBeFittedMayBeMissing) {
  const std::vector<std::pair<std::string, std::function<void(v1::Recordings*)>>> cases = {
      {"lens.transmission", [](auto* m) { m->mutable_lens()->clear_transmission(); }},
      {"laser.power_w", [](auto* m) { m->mutable_laser()->clear_power_w(); }},
      {"laser.divergence_rad", [](auto* m) { m->mutable_laser()->clear_divergence_rad(); }},
      {"laser.fan_angle_deg", [](auto* m) { m->mutable_laser()->clear_fan_angle_deg(); }},
      {"laser.beam_focus_distance_m",
       [](auto* m) { m->mutable_laser()->clear_beam_focus_distance_m(); }},
      {"surface.ggx_alpha", [](auto* m) { m->clear_surface(); }},
      {"rig.incidence_angle_deg", [](auto* m) { m->clear_rig(); }},
      {"camera.gain_dn_per_electron",
       [](auto* m) { m->mutable_camera()->clear_gain_dn_per_electron(); }},
      {"camera.saturation_capacity_electrons",
       [](auto* m) { m->mutable_camera()->clear_saturation_capacity_electrons(); }},
      {"camera.quantum_efficiency",
       [](auto* m) { m->mutable_camera()->clear_quantum_efficiency(); }},
      {"camera.dark_mean_electrons",
       [](auto* m) { m->mutable_camera()->clear_dark_mean_electrons(); }},
      {"camera.dark_noise_electrons",
       [](auto* m) { m->mutable_camera()->clear_dark_noise_electrons(); }},
      {"focus_distance_m", [](auto* m) { m->mutable_recordings(0)->clear_focus_distance_m(); }},
      {"laser_distance_m", [](auto* m) { m->mutable_recordings(0)->clear_laser_distance_m(); }},
      {"timestamp_s", [](auto* m) {
         for (auto& recording : *m->mutable_recordings()) recording.clear_timestamp_s();
       }}};
  for (const auto& [field, clear] : cases) {
    v1::Recordings message = Plate();
    clear(&message);
    EXPECT_FALSE(ParseRecordings(message, "").ok()
                 // Sensors have had a default of 0 for it.
                 && field != "camera.dark_mean_electrons")
        << field;
    EXPECT_THAT(AssumeMissingValues(&message), ::testing::Contains(HasSubstr(field)));
    EXPECT_TRUE(ParseRecordings(message, "").ok()) << ParseRecordings(message, "").status();
  }
}

TEST(AssumedValues, UncertaintyIsTheWiderOfStatedAndAssumed) {
  v1::Recordings message = Plate();
  message.mutable_laser()->clear_power_w();
  message.mutable_rig()->clear_incidence_angle_deg();
  message.mutable_uncertainty()->set_incidence_angle_deg(25);
  AssumeMissingValues(&message);
  EXPECT_DOUBLE_EQ(message.uncertainty().incidence_angle_deg(), 25);
  EXPECT_GE(message.uncertainty().power_relative(), 1);
  EXPECT_DOUBLE_EQ(message.uncertainty().camera_distance_m(), 0.002);
}

TEST(AssumedValues, WhatNothingCanReplaceStaysAnError) {
  const std::vector<std::function<void(v1::Recordings*)>> cases = {
      [](auto* m) { m->mutable_camera()->clear_pixel_pitch_m(); },
      [](auto* m) { m->mutable_camera()->clear_bit_depth_bit(); },
      [](auto* m) { m->mutable_lens()->clear_focal_length_m(); },
      [](auto* m) { m->mutable_laser()->clear_wavelength_m(); },
      [](auto* m) { m->mutable_recordings(0)->clear_exposure_time_s(); },
      [](auto* m) { m->mutable_recordings(0)->clear_camera_distance_m(); },
      [](auto* m) { m->clear_recordings(); },
      [](auto* m) { m->Clear(); }};
  for (const auto& clear : cases) {
    v1::Recordings message = Plate();
    clear(&message);
    AssumeMissingValues(&message);
    EXPECT_FALSE(ParseRecordings(message, "").ok());
  }
}

}  // namespace
}  // namespace sightline
