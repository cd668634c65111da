// SPDX-License-Identifier: Apache-2.0
// Format version 3: reading, validation, values that are not stated.
#include "core/recordings/posed_plates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "core/json/strict_json.h"
#include "core/recordings/assumed_values.h"
#include "core/recordings/recordings.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

// A laser 0.3 m above the camera in the plane of x and the point (0, 0, 0.3).
v1::Recordings Posed() {
  v1::Recordings m;
  const absl::Status status = ParseStrictJson(R"({
    "format": "laser-line-recordings", "format_version": 3, "set": "posed",
    "camera": {"sensor_type": "mono", "pixel_pitch_m": 5e-6, "sensor_columns_px": 640,
      "sensor_rows_px": 480, "bit_depth_bit": 8, "quantum_efficiency": {"mono": 0.5},
      "gain_dn_per_electron": 0.0255, "saturation_capacity_electrons": 10000,
      "dark_mean_electrons": 30, "dark_noise_electrons": 6},
    "lens": {"focal_length_m": 0.01, "transmission": 0.9},
    "laser": {"wavelength_m": 6.6e-7, "power_w": 0.001, "divergence_rad": 0.001,
      "beam_focus_distance_m": 0.4, "fan_angle_deg": 45},
    "surface": {"diffuse_albedo": 0.5, "specular_f0": 0.04, "ggx_alpha": 0.5},
    "pixel_camera": {"focal_length_px": 2068, "principal_point_column_px": 320,
      "principal_point_row_px": 240, "distortion": {"k1": -0.1}},
    "laser_plane": {"normal": {"x": 0, "y": 0.7071067811865476, "z": 0.7071067811865476},
      "offset_m": 0.21213203435596428, "origin_m": {"x": 0, "y": 0.3, "z": 0}},
    "recordings": [
      {"file": "images/000.png", "kind": "laser", "timestamp_s": 0, "plate_position_id": 1,
       "same_speckle": false, "burst_frame_index": 0, "exposure_time_s": 0.001, "f_number": 8,
       "focus_distance_m": 0.3, "roi_column_px": -320, "roi_row_px": -100, "roi_columns_px": 640,
       "roi_rows_px": 200, "repeat_group": 0,
       "plate_pose": {"rotation": [1, 0, 0, 0, -1, 0, 0, 0, -1],
         "translation_m": {"x": 0, "y": 0, "z": 0.3}}},
      {"file": "images/001.png", "kind": "dark", "timestamp_s": 1, "same_speckle": false,
       "burst_frame_index": 0, "exposure_time_s": 0.001, "f_number": 8, "focus_distance_m": 0.3,
       "roi_column_px": -320, "roi_row_px": -100, "roi_columns_px": 640, "roi_rows_px": 200,
       "repeat_group": 1}]})",
                                              "recordings.json", &m);
  EXPECT_TRUE(status.ok()) << status;
  return m;
}

TEST(PosedPlates, AreReadAndWrittenBack) {
  const auto set = ParseRecordings(Posed(), "r.json");
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_TRUE(set->posed);
  EXPECT_EQ(set->posed->camera.fx, 2068);
  EXPECT_EQ(set->posed->camera.distortion[0], -0.1);
  EXPECT_NEAR(set->posed->sheet.normal.norm(), 1, 1e-12);
  ASSERT_TRUE(set->recordings[0].plate_in_camera);
  EXPECT_FALSE(set->recordings[1].plate_in_camera);
  const auto again = ParseRecordings(RecordingsToProto(*set), "again");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(again->recordings[0].plate_in_camera->isApprox(*set->recordings[0].plate_in_camera));
  EXPECT_EQ(again->recordings[0].roi_row_px, -100);
  EXPECT_EQ(*again->posed->sheet.origin_m, *set->posed->sheet.origin_m);
}

TEST(PosedPlates, ErrorsNameFieldValueAndRange) {
  using Change = std::function<void(v1::Recordings*)>;
  const auto pose = [](v1::Recordings* m) {
    return m->mutable_recordings(0)->mutable_plate_pose();
  };
  const struct {
    Change change;
    std::string expected;
  } cases[] = {
      {[](auto* m) { m->clear_pixel_camera(); }, "pixel_camera is missing"},
      {[](auto* m) { m->mutable_pixel_camera()->clear_focal_length_px(); },
       "pixel_camera.focal_length_px is missing"},
      {[](auto* m) { m->mutable_pixel_camera()->set_focal_length_px(-5); },
       "pixel_camera.focal_length_px is -5, must be in (10, 1000000] px"},
      {[](auto* m) { m->mutable_pixel_camera()->set_principal_point_row_px(5000); },
       "pixel_camera.principal_point_row_px is 5000"},
      {[](auto* m) { m->clear_laser_plane(); }, "laser_plane is missing"},
      {[](auto* m) { m->mutable_laser_plane()->mutable_normal()->Clear(); },
       "laser_plane.normal has the length 0"},
      {[](auto* m) { m->mutable_laser_plane()->clear_offset_m(); },
       "laser_plane.offset_m is missing"},
      {[](auto* m) { m->mutable_laser_plane()->mutable_origin_m()->set_y(0.31); },
       "laser_plane.origin_m is 7.071 mm off the laser plane"},
      {[](auto* m) { m->mutable_recordings(0)->clear_plate_pose(); },
       "recordings[0].plate_pose is missing"},
      {[&](auto* m) { pose(m)->mutable_rotation()->RemoveLast(); },
       "recordings[0].plate_pose.rotation has 8 numbers, must have nine"},
      {[&](auto* m) { pose(m)->set_rotation(0, 1.01); },
       "recordings[0].plate_pose.rotation is no rotation"},
      {[&](auto* m) { pose(m)->set_rotation(0, -1); },
       "recordings[0].plate_pose.rotation has the determinant -1"},
      {[&](auto* m) { pose(m)->clear_translation_m(); },
       "recordings[0].plate_pose.translation_m is missing"},
      {[&](auto* m) { pose(m)->mutable_translation_m()->set_z(-0.3); },
       "recordings[0].plate_pose.translation_m has z = -0.3, must be in (0, 100] m"},
      {[&](auto* m) { pose(m)->mutable_translation_m()->set_z(0.5); },
       "recordings[0].plate_pose does not fit: the line of the laser plane on the plate lies "
       "outside"},
      {[&](auto* m) {
         const double h = 0.7071067811865476;
         const double rows[] = {1, 0, 0, 0, h, h, 0, -h, h};  // its normal is that of the laser
         for (int i = 0; i < 9; ++i) pose(m)->set_rotation(i, rows[i]);
       },
       "recordings[0].plate_pose does not fit: the plate is parallel to the laser plane"},
      {[](auto* m) { m->mutable_rig()->set_incidence_angle_deg(45); },
       "rig belongs to format_version 1"},
      {[](auto* m) { m->mutable_recordings(1)->set_burst_frame_index(1); },
       "recordings[1].burst_frame_index is 1, must be 0 in format_version 3"},
      {[](auto* m) {
         m->mutable_camera()->set_sensor_type("bayer_rggb");
         m->mutable_camera()->mutable_quantum_efficiency()->set_red(0.5);
         m->mutable_camera()->mutable_quantum_efficiency()->set_green(0.5);
         m->mutable_camera()->mutable_quantum_efficiency()->set_blue(0.5);
         m->mutable_camera()->mutable_quantum_efficiency()->clear_mono();
       },
       "camera.sensor_type must be mono in format_version 3"},
      {[](auto* m) {
         m->set_format_version(1);
         m->mutable_rig()->set_incidence_angle_deg(45);
       },
       "pixel_camera belongs to format_version 3"},
  };
  for (const auto& c : cases) {
    v1::Recordings message = Posed();
    c.change(&message);
    const auto set = ParseRecordings(message, "r.json");
    EXPECT_EQ(set.status().code(), absl::StatusCode::kInvalidArgument) << c.expected;
    EXPECT_THAT(std::string(set.status().message()), HasSubstr("r.json: " + c.expected));
  }
}

TEST(PosedPlates, UnknownLengthsFollowFromEachOther) {
  v1::Recordings message = Posed();
  message.mutable_camera()->clear_pixel_pitch_m();
  message.mutable_recordings(0)->clear_focus_distance_m();
  auto notes = AssumeMissingValues(&message);
  // The focal length of 10 mm, focused at 0.3 m, makes 2068 px.
  EXPECT_NEAR(message.camera().pixel_pitch_m(), 5e-6, 5e-9);
  EXPECT_NEAR(message.recordings(0).focus_distance_m(), 0.3, 1e-9);
  EXPECT_THAT(notes, ::testing::Contains(HasSubstr("follows from lens.focal_length_m")));

  message = Posed();
  message.mutable_camera()->clear_pixel_pitch_m();
  message.mutable_lens()->clear_focal_length_m();
  for (v1::Recording& recording : *message.mutable_recordings()) {
    recording.clear_exposure_time_s();
    recording.clear_f_number();
    recording.clear_focus_distance_m();
    recording.clear_plate_position_id();
  }
  notes = AssumeMissingValues(&message);
  EXPECT_THAT(notes, ::testing::Contains(HasSubstr("camera.pixel_pitch_m is not stated")));
  EXPECT_THAT(notes, ::testing::Contains(HasSubstr("recordings[].exposure_time_s is not stated")));
  EXPECT_GE(message.uncertainty().power_relative(), 1);
  EXPECT_GE(message.uncertainty().f_number_relative(), 0.2);
  const auto set = ParseRecordings(message, "r.json");
  EXPECT_TRUE(set.ok()) << set.status();
}

}  // namespace
}  // namespace sightline
