// SPDX-License-Identifier: Apache-2.0
#include "report/raw_image/preview_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <filesystem>
#include <fstream>

namespace sightline {
namespace {

using ::testing::HasSubstr;

// Dark but for a line of a few hundred numbers of 65535, as a 10-bit sensor records it.
RawPng DarkWithLine(int columns, int rows) {
  RawPng raw{.columns_px = columns, .rows_px = rows, .values_dn = {}};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const bool line = row >= rows / 2 && row < rows / 2 + 3;
      raw.values_dn.push_back(static_cast<uint16_t>(line ? 700 : 20 + (row + column) % 8));
    }
  }
  return raw;
}

struct Picture {
  png_uint_32 columns = 0, rows = 0;
  bool colour = false;
  std::vector<uint8_t> values;
};

Picture Decode(const std::string& png) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_TRUE(png_image_begin_read_from_memory(&image, png.data(), png.size()));
  Picture picture{image.width, image.height, (image.format & PNG_FORMAT_FLAG_COLOR) != 0, {}};
  image.format = picture.colour ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
  picture.values.resize(PNG_IMAGE_SIZE(image));
  EXPECT_TRUE(png_image_finish_read(&image, nullptr, picture.values.data(), 0, nullptr));
  return picture;
}

TEST(PreviewPng, ShowsADarkLineBrightly) {
  const auto png = PreviewPng(DarkWithLine(200, 100), false);
  ASSERT_TRUE(png.ok()) << png.status();
  EXPECT_THAT(*png, HasSubstr("not data"));
  const Picture picture = Decode(*png);
  EXPECT_EQ(picture.columns, 200u);
  EXPECT_EQ(picture.rows, 100u);
  EXPECT_FALSE(picture.colour);
  EXPECT_EQ(picture.values[51 * 200 + 7], 255);
  EXPECT_LT(picture.values[3 * 200 + 7], 60);
}

// Grey under ambient light whatever the channels' sensitivities; a red line stays red.
TEST(PreviewPng, BalancesAmbientLightAndKeepsTheLinesColour) {
  RawPng raw{.columns_px = 200, .rows_px = 100, .values_dn = {}};
  for (int row = 0; row < 100; ++row) {
    for (int column = 0; column < 200; ++column) {
      const bool red = row % 2 == 0 && column % 2 == 0, blue = row % 2 == 1 && column % 2 == 1;
      const int ambient = column < 20 ? 0 : red ? 50 : blue ? 40 : 100;
      const bool line = row >= 50 && row < 54;
      raw.values_dn.push_back(static_cast<uint16_t>(10 + ambient + (line && red ? 900 : 0)));
    }
  }
  const auto png = PreviewPng(raw, true);
  ASSERT_TRUE(png.ok()) << png.status();
  const Picture picture = Decode(*png);
  ASSERT_TRUE(picture.colour);
  const auto at = [&](int row, int column, int channel) {
    return int{picture.values[static_cast<size_t>(3 * (row * 200 + column) + channel)]};
  };
  EXPECT_NEAR(at(10, 100, 0), at(10, 100, 1), 1);
  EXPECT_NEAR(at(10, 100, 2), at(10, 100, 1), 1);
  EXPECT_GT(at(51, 100, 0), at(51, 100, 1) + 80);
}

TEST(PreviewPng, FlatAndTinyImagesAreNoError) {
  for (const int side : {1, 2, 3}) {
    const RawPng raw{.columns_px = side,
                     .rows_px = side,
                     .values_dn = std::vector<uint16_t>(static_cast<size_t>(side * side), 17)};
    for (const bool bayer : {false, true}) {
      const auto png = PreviewPng(raw, bayer);
      ASSERT_TRUE(png.ok()) << png.status();
      EXPECT_EQ(Decode(*png).values[0], 0);
    }
  }
}

TEST(ReadRawPng, RefusesWhatIsNone) {
  const std::string file = std::filesystem::temp_directory_path() / "sightline-no-picture.png";
  std::ofstream(file) << "no picture";
  EXPECT_THAT(std::string(ReadRawPng(file, 1000).status().message()),
              HasSubstr("sightline-no-picture.png"));
  std::ofstream(file, std::ios::binary) << *EncodePng(std::vector<uint8_t>(100, 3), 10, 10, false);
  EXPECT_TRUE(ReadRawPng(file, 100).ok());
  EXPECT_FALSE(ReadRawPng(file, 99).ok());
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace sightline
