// SPDX-License-Identifier: Apache-2.0
#include "render_worker/image_file/image_file.h"

#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace sightline {
namespace {

namespace fs = std::filesystem;

class ImageFileTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  static std::string Bytes(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  size_t FileCount() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder_), {}));
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / "image_file_test";
};

Image<uint16_t> Ramp() {
  Image<uint16_t> image(37, 5);
  for (size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<uint16_t>(i * 353 % 65536);
  }
  image.values[3] = 65535;
  return image;
}

TEST_F(ImageFileTest, RawNumbersAndTextComeBack) {
  for (const ImageFormat format : {ImageFormat::kPng, ImageFormat::kTiff}) {
    const fs::path path = folder_ / (std::string("raw") + FileExtension(format));
    const std::string description = "{\n  \"exposure_time_s\": 0.01\n}";
    ASSERT_TRUE(WriteRawImage(path, Ramp(), description, format).ok());
    const auto back = ReadRawImage(path);
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, Ramp());
    const auto file = OIIO::ImageInput::open(path);
    ASSERT_NE(file, nullptr);
    EXPECT_EQ(std::string(file->spec().get_string_attribute("ImageDescription")), description);
  }
  EXPECT_EQ(FileCount(), 2u);
}

// No time of day, no host.
TEST_F(ImageFileTest, SameImageSameBytes) {
  for (const ImageFormat format : {ImageFormat::kPng, ImageFormat::kTiff}) {
    const fs::path path = folder_ / (std::string("raw") + FileExtension(format));
    ASSERT_TRUE(WriteRawImage(path, Ramp(), "x", format).ok());
    const std::string bytes = Bytes(path);
    EXPECT_EQ(bytes.find("20"
                         "2"),
              std::string::npos);  // a year
    ASSERT_TRUE(WriteRawImage(path, Ramp(), "x", format).ok());
    EXPECT_EQ(Bytes(path), bytes);
  }
}

TEST_F(ImageFileTest, LayersKeepTheirNamesAndFloats) {
  Image<float> radiance(8, 4, 0.125F), depth(8, 4, 0.331F);
  radiance.At(2, 3) = 1e6F;
  const fs::path path = folder_ / "layers.exr";
  ASSERT_TRUE(
      WriteLayers(path, {{"laser_radiance_w_m2_sr", &radiance}, {"depth_m", &depth}}, "d").ok());
  const auto file = OIIO::ImageInput::open(path);
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(file->spec().format, OIIO::TypeDesc::FLOAT);
  std::vector<float> values(2 * 8 * 4);
  ASSERT_TRUE(file->read_image(0, 0, 0, 2, OIIO::TypeDesc::FLOAT, values.data()));
  // OpenEXR orders channels by name.
  const int depth_channel = file->spec().channelindex("depth_m");
  const int radiance_channel = file->spec().channelindex("laser_radiance_w_m2_sr");
  ASSERT_GE(depth_channel, 0);
  ASSERT_GE(radiance_channel, 0);
  EXPECT_EQ(values[2 * (2 * 8 + 3) + radiance_channel], 1e6F);
  EXPECT_EQ(values[2 * (2 * 8 + 3) + depth_channel], 0.331F);
}

TEST_F(ImageFileTest, ErrorsNameTheFileAndLeaveNothing) {
  const absl::Status status =
      WriteRawImage(folder_ / "none" / "raw.png", Ramp(), "", ImageFormat::kPng);
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("none/raw.png"));
  EXPECT_EQ(FileCount(), 0u);
  EXPECT_EQ(ReadRawImage(folder_ / "none.png").status().code(), absl::StatusCode::kNotFound);
  std::ofstream(folder_ / "text.png") << "no image";
  EXPECT_EQ(ReadRawImage(folder_ / "text.png").status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
