// SPDX-License-Identifier: Apache-2.0
#include "planner_client/render_client/draft_picture.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

namespace sightline {
namespace {

v1::Inspection SensorInspection(int columns, int rows) {
  v1::Inspection inspection;
  v1::Sensor& sensor = *inspection.mutable_camera()->mutable_sensor();
  sensor.set_sensor_columns_px(columns);
  sensor.set_sensor_rows_px(rows);
  sensor.set_pixel_pitch_m(5e-6);
  inspection.mutable_render()->set_exposure_time_s(0.016);
  inspection.mutable_render()->set_stage_speed_m_per_s(0.01);
  return inspection;
}

TEST(DraftSpec, JoinsPixelsAndKeepsFieldOfViewAndLightPerPixel) {
  v1::PartFrame frame;
  frame.mutable_setting()->set_exposure_time_s(0.032);
  int reduction = 0;
  const v1::RenderSpec spec = DraftSpec(SensorInspection(1920, 1200), frame, 150'000, &reduction);
  EXPECT_EQ(reduction, 4);
  const v1::Inspection& draft = spec.part().inspection();
  EXPECT_EQ(draft.camera().sensor().sensor_columns_px(), 480);
  EXPECT_EQ(draft.camera().sensor().sensor_rows_px(), 300);
  EXPECT_DOUBLE_EQ(300 * draft.camera().sensor().pixel_pitch_m(), 1200 * 5e-6);
  EXPECT_DOUBLE_EQ(draft.render().exposure_time_s(), 0.001);
  EXPECT_DOUBLE_EQ(spec.part().frames(0).setting().exposure_time_s(), 0.002);
  // The way of the stage during the exposure stays.
  EXPECT_DOUBLE_EQ(draft.render().stage_speed_m_per_s(), 0.16);
  EXPECT_FALSE(draft.render().speckle());
}

TEST(DraftSpec, SmallCamerasStayAsTheyAre) {
  int reduction = 0;
  const v1::RenderSpec spec =
      DraftSpec(SensorInspection(300, 200), v1::PartFrame(), 90'000, &reduction);
  EXPECT_EQ(reduction, 1);
  EXPECT_EQ(spec.part().inspection().camera().sensor().sensor_columns_px(), 300);
  EXPECT_DOUBLE_EQ(spec.part().inspection().render().exposure_time_s(), 0.016);
}

TEST(DraftSpec, RegionOfTheSensorIsReducedToo) {
  v1::Inspection inspection = SensorInspection(1920, 1200);
  inspection.mutable_camera()->set_rows_px(400);
  int reduction = 0;
  const v1::RenderSpec spec = DraftSpec(inspection, v1::PartFrame(), 90'000, &reduction);
  EXPECT_EQ(reduction, 3);
  // A multiple of four, so that a colour mosaic begins with a whole cell.
  EXPECT_EQ(spec.part().inspection().camera().rows_px(), 132);
}

class PictureOfRawTest : public ::testing::Test {
 protected:
  void Write(uint32_t columns, uint32_t rows, const std::vector<uint16_t>& values) {
    png_image image = {};
    image.version = PNG_IMAGE_VERSION;
    image.width = columns;
    image.height = rows;
    image.format = PNG_FORMAT_LINEAR_Y;
    ASSERT_TRUE(png_image_write_to_file(&image, file_.c_str(), 0, values.data(), 0, nullptr));
  }
  static std::vector<uint8_t> Read(const DraftPicture& picture, bool colour) {
    png_image image = {};
    image.version = PNG_IMAGE_VERSION;
    EXPECT_TRUE(png_image_begin_read_from_memory(&image, picture.png.data(), picture.png.size()));
    image.format = colour ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
    std::vector<uint8_t> values(PNG_IMAGE_SIZE(image));
    EXPECT_TRUE(png_image_finish_read(&image, nullptr, values.data(), 0, nullptr));
    return values;
  }

  const std::string file_ = (std::filesystem::temp_directory_path() /
                             ("picture_of_raw_" + std::to_string(getpid()) + ".png"))
                                .string();
  ~PictureOfRawTest() override { std::filesystem::remove(file_); }
};

TEST_F(PictureOfRawTest, BrightnessIsThatOfTheSensorsScale) {
  Write(2, 2, {10, 1023, 516, 2});
  const auto picture = PictureOfRaw(file_, 10, 10, false);
  ASSERT_TRUE(picture.ok()) << picture.status();
  const std::vector<uint8_t> grey = Read(*picture, false);
  EXPECT_EQ(grey[0], 0);
  EXPECT_EQ(grey[1], 255);
  EXPECT_GT(grey[2], 150);
  EXPECT_LT(grey[2], 220);
  EXPECT_EQ(grey[3], 0);
  EXPECT_DOUBLE_EQ(picture->clipped_fraction, 0.25);
}

TEST_F(PictureOfRawTest, MosaicBecomesColour) {
  // Red alone: rows and columns 0 and 2.
  Write(4, 2, {1023, 0, 1023, 0, 0, 0, 0, 0});
  const auto picture = PictureOfRaw(file_, 10, 0, true);
  ASSERT_TRUE(picture.ok()) << picture.status();
  const std::vector<uint8_t> rgb = Read(*picture, true);
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(rgb[3 * i], 255);
    EXPECT_EQ(rgb[3 * i + 1], 0);
    EXPECT_EQ(rgb[3 * i + 2], 0);
  }
}

TEST_F(PictureOfRawTest, WhatIsNoImageIsAnError) {
  EXPECT_FALSE(PictureOfRaw(file_, 10, 0, false).ok());
  std::ofstream(file_) << "not a PNG";
  EXPECT_FALSE(PictureOfRaw(file_, 10, 0, false).ok());
}

}  // namespace
}  // namespace sightline
