// SPDX-License-Identifier: Apache-2.0
#include "render_worker/recordings/plate_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace sightline {
namespace {

RecordingSet Set() {
  RecordingSet set;
  set.camera.quantum_efficiency[0] = {{661e-9}, {0.5}};
  set.focal_length_m = 0.016;
  set.transmission = 0.9;
  set.surface = {0.35, 0.66, 0.43};
  set.incidence_angle_rad = 0.7;
  for (int i = 0; i < 3; ++i) {
    RecordedImage image;
    image.plate_position_id = i < 2 ? 7 : 8;
    image.exposure_time_s = 0.01;
    image.f_number = 4;
    image.camera_distance_m = 0.33;
    image.focus_distance_m = 0.3;
    image.laser_distance_m = 0.41;
    image.line_offset_m = 1e-3;
    image.burst_frame_index = 0;
    set.recordings.push_back(image);
  }
  return set;
}

TEST(PlateFrame, SpeckleGoesWithThePlateAndNoiseWithTheFrame) {
  const RecordingSet set = Set();
  const FrameSetup a = PlateFrame(set, 0, {}), b = PlateFrame(set, 1, {}),
                   c = PlateFrame(set, 2, {});
  EXPECT_EQ(a.seeds.speckle, b.seeds.speckle);
  EXPECT_NE(a.seeds.speckle, c.seeds.speckle);
  EXPECT_NE(a.seeds.noise, b.seeds.noise);
  EXPECT_EQ(a.seeds.camera, c.seeds.camera);
  EXPECT_EQ(a.plate.line_offset_m, 1e-3);
  EXPECT_NE(PlateFrame(set, 0, {.deviation = {}, .seed = 2}).seeds.speckle, a.seeds.speckle);
}

TEST(PlateFrame, DeviationsAreTrueMinusNominal) {
  const RecordingSet set = Set();
  PlateFrameOptions options;
  options.deviation.camera_distance_m = -0.001;
  options.deviation.f_number_relative = 0.05;
  options.deviation.quantum_efficiency_relative = -0.1;
  options.deviation.incidence_angle_rad = 0.01;
  options.deviation.dark_mean_electrons = 2;
  options.deviation.line_position_common_px = 1.5;
  const FrameSetup nominal = PlateFrame(set, 0, {}), frame = PlateFrame(set, 0, options);
  EXPECT_DOUBLE_EQ(frame.plate.camera_distance_m, 0.329);
  EXPECT_DOUBLE_EQ(frame.lens.f_number, 4.2);
  EXPECT_DOUBLE_EQ(frame.sensor.quantum_efficiency[0].quantum_efficiency[0], 0.45);
  EXPECT_DOUBLE_EQ(frame.plate.incidence_angle_rad, 0.71);
  EXPECT_DOUBLE_EQ(frame.sensor.dark_mean_electrons, nominal.sensor.dark_mean_electrons + 2);
  // The line moves by 1.5 px in the image: m = b / d_c.
  const double b = 1 / (1 / 0.016 - 1 / 0.3);
  EXPECT_NEAR((frame.plate.line_offset_m - 1e-3) * (b / 0.329) / frame.sensor.pixel_pitch_m, 1.5,
              1e-9);
}

// Drawn once for every plate position, with the stated spread.
TEST(PlateFrame, LinePositionIsDrawnForEveryPlatePosition) {
  RecordingSet set = Set();
  PlateFrameOptions options;
  options.deviation.line_position_each_px = 0.3;
  EXPECT_EQ(PlateFrame(set, 0, options).plate.line_offset_m,
            PlateFrame(set, 1, options).plate.line_offset_m);
  const double scale = (1 / (1 / 0.016 - 1 / 0.3)) / 0.33 / set.camera.pixel_pitch_m;
  double sum = 0, squares = 0;
  constexpr int kCount = 2000;
  for (int i = 0; i < kCount; ++i) {
    set.recordings[0].plate_position_id = i;
    const double shift_px = (PlateFrame(set, 0, options).plate.line_offset_m - 1e-3) * scale;
    EXPECT_LE(std::abs(shift_px), 0.6 + 1e-9);
    sum += shift_px;
    squares += shift_px * shift_px;
  }
  // A standard normal clipped to +-2 has variance 0.9205; its square spreads by 1.11. Four standard
  // errors.
  EXPECT_NEAR(sum / kCount, 0, 4 * 0.3 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount / 0.09, 0.9205, 4 * 1.11 / std::sqrt(kCount));
}

}  // namespace
}  // namespace sightline
