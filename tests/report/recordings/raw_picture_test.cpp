// SPDX-License-Identifier: Apache-2.0
#include "report/recordings/raw_picture.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "render_worker/image_file/image_file.h"

namespace sightline {
namespace {

class RawPicture : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/raw_picture_test";
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Image<uint16_t> Decode(const std::string& png) {
    std::ofstream(folder_ + "/picture.png", std::ios::binary) << png;
    const auto image = ReadRawImage(folder_ + "/picture.png");
    EXPECT_TRUE(image.ok()) << image.status();
    return image.value_or(Image<uint16_t>());
  }

  std::string folder_;
};

TEST_F(RawPicture, ShowsTenBitsOnTheWholeGreyScale) {
  Image<uint16_t> raw(64, 40, 20);
  for (int column = 0; column < 64; ++column) {
    raw.At(20, column) = 1020;
    raw.At(21, column) = 270;  // a quarter of the signal is half as bright
  }
  ASSERT_TRUE(WriteRawImage(folder_ + "/raw.png", raw, "", ImageFormat::kPng).ok());
  const Image<uint16_t> picture = Decode(RawPicturePng(folder_, "raw.png"));
  ASSERT_EQ(picture.columns_px, 64);
  ASSERT_EQ(picture.rows_px, 40);
  EXPECT_EQ(picture.At(0, 0), 0);
  EXPECT_EQ(picture.At(20, 5), 255);
  EXPECT_NEAR(picture.At(21, 5), 127.5, 1);
}

TEST_F(RawPicture, KeepsThinLinesOfLargeImages) {
  Image<uint16_t> raw(1500, 300, 10);
  for (int column = 0; column < 1500; ++column) raw.At(151, column) = 4000;
  ASSERT_TRUE(WriteRawImage(folder_ + "/raw.png", raw, "", ImageFormat::kPng).ok());
  const Image<uint16_t> picture = Decode(RawPicturePng(folder_, "raw.png"));
  EXPECT_EQ(picture.columns_px, 500);
  ASSERT_EQ(picture.rows_px, 100);
  EXPECT_EQ(picture.At(50, 250), 255);
  EXPECT_EQ(picture.At(49, 250), 0);
}

TEST_F(RawPicture, IsEmptyWithoutAUsableImage) {
  EXPECT_EQ(RawPicturePng("", "raw.png"), "");
  EXPECT_EQ(RawPicturePng(folder_, "missing.png"), "");
  std::ofstream(folder_ + "/text.png") << "no image";
  EXPECT_EQ(RawPicturePng(folder_, "text.png"), "");
  ASSERT_TRUE(
      WriteRawImage(folder_ + "/raw.png", Image<uint16_t>(8, 8, 1), "", ImageFormat::kPng).ok());
  EXPECT_EQ(RawPicturePng(folder_ + "/sub", "../raw.png"), "");
  EXPECT_EQ(RawPicturePng(folder_, folder_ + "/raw.png"), "");
  EXPECT_NE(RawPicturePng(folder_, "raw.png"), "");
}

}  // namespace
}  // namespace sightline
