// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/sensor_set_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class SensorSetFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    fs::create_directories(fs::path(folder_) / "camera/images");
    camera_ = folder_ + "/camera";
  }
  void TearDown() override { fs::remove_all(folder_); }

  void Write(const std::string& file, const std::string& text) const {
    std::ofstream(fs::path(camera_) / file, std::ios::binary) << text;
  }
  // Two images with light and `second` without.
  void WriteSet(const std::string& second = "images\\d_1.png\ni images\\d_2.png") const {
    Write("EMVA1288_Data.txt",
          "v 3.0\r\nn 12 640 480\r\nb 40000.0 120.0\r\ni images\\b_1.png\r\ni images\\b_2.png\r\n"
          "d 40000.0\r\ni " +
              second + "\r\n");
    for (const char* image : {"b_1", "b_2", "d_1", "d_2"}) {
      Write(std::string("images/") + image + ".png", image);
    }
  }
  std::string Error(const std::string& path, absl::StatusCode code) const {
    const auto set = ReadSensorSetFolder(path);
    EXPECT_EQ(set.status().code(), code) << set.status();
    return std::string(set.status().message());
  }

  std::string folder_ = "/tmp/sightline-sensor-set-XXXXXX";
  std::string camera_;
};

TEST_F(SensorSetFolderTest, KnowsASensorSet) {
  EXPECT_FALSE(IsSensorSet(camera_));
  EXPECT_FALSE(IsSensorSet(camera_ + "/recordings.json"));
  EXPECT_FALSE(IsSensorSet(folder_ + "/nothing"));
  EXPECT_TRUE(IsSensorSet(folder_ + "/any.txt"));
  EXPECT_TRUE(IsSensorSet(folder_ + "/ANY.TXT"));
  Write("emva1288_DATA.TXT", "");
  EXPECT_TRUE(IsSensorSet(camera_));
  // Recordings of a plate may lie beside frames of their camera.
  Write("recordings.json", "{}");
  EXPECT_FALSE(IsSensorSet(camera_));
  fs::create_directories(folder_ + "/folder.txt");
  EXPECT_FALSE(IsSensorSet(folder_ + "/folder.txt"));
}

TEST_F(SensorSetFolderTest, ReadsTheFolderOrItsFile) {
  WriteSet();
  for (const std::string& path : {camera_, camera_ + "/", camera_ + "/EMVA1288_Data.txt"}) {
    const auto set = ReadSensorSetFolder(path);
    ASSERT_TRUE(set.ok()) << set.status();
    EXPECT_EQ(set->set.name(), "camera");
    EXPECT_EQ(set->set.steps_size(), 2);
    ASSERT_EQ(set->images.size(), 4u);
    EXPECT_EQ(set->images[2].file, "images/d_1.png");
    EXPECT_EQ(set->images[2].bytes, "d_1");
    EXPECT_EQ(set->set.steps(1).files(0), set->images[2].file);
    EXPECT_TRUE(fs::equivalent(set->folder, camera_));
    EXPECT_TRUE(fs::equivalent(set->description_file, camera_ + "/EMVA1288_Data.txt"));
  }
  fs::rename(camera_ + "/EMVA1288_Data.txt", camera_ + "/emva1288_data.txt");
  const auto set = ReadSensorSetFolder(camera_);
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->images.size(), 4u);
}

TEST_F(SensorSetFolderTest, NamesMissingImages) {
  WriteSet();
  fs::remove(camera_ + "/images/b_2.png");
  // A folder is no image.
  fs::remove(camera_ + "/images/d_1.png");
  fs::create_directories(camera_ + "/images/d_1.png");
  EXPECT_THAT(Error(camera_, absl::StatusCode::kNotFound),
              HasSubstr("EMVA1288_Data.txt: 2 of 4 images cannot be read: images/b_2.png "
                        "(steps[0]), images/d_1.png (steps[1])"));
  std::string many = "n_0.png";
  for (int i = 1; i < 9; ++i) many += "\ni n_" + std::to_string(i) + ".png";
  WriteSet(many);
  const std::string error = Error(camera_, absl::StatusCode::kNotFound);
  EXPECT_THAT(error, HasSubstr("9 of 11 images cannot be read: n_0.png (steps[1])"));
  EXPECT_THAT(error, HasSubstr("n_4.png (steps[1]) and 4 more"));
  EXPECT_THAT(error, Not(HasSubstr("n_5.png")));
}

TEST_F(SensorSetFolderTest, RefusesAnEmptyImage) {
  WriteSet();
  Write("images/d_2.png", "");
  EXPECT_THAT(Error(camera_, absl::StatusCode::kInvalidArgument),
              HasSubstr("images/d_2.png: is empty"));
}

TEST_F(SensorSetFolderTest, RefusesImagesOutsideOfTheFolder) {
  Write("../secret.png", "secret");
  for (const char* image : {"../secret.png", "..\\secret.png", "images/../../secret.png",
                            "/etc/passwd", "\\\\server\\share\\a.png", "C:\\a.png", "c:a.png"}) {
    WriteSet(std::string(image) + "\ni images/d_2.png");
    const std::string error = Error(camera_, absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(error, HasSubstr("EMVA1288_Data.txt: ")) << image;
    EXPECT_THAT(error, HasSubstr("within the folder")) << image;
  }
}

TEST_F(SensorSetFolderTest, RefusesWhatIsNoDataFile) {
  EXPECT_THAT(Error(camera_, absl::StatusCode::kNotFound),
              HasSubstr("camera/EMVA1288_Data.txt: cannot be read"));
  EXPECT_THAT(Error(folder_ + "/none.txt", absl::StatusCode::kNotFound),
              HasSubstr("none.txt: cannot be read"));
  Write("EMVA1288_Data.txt", "");
  EXPECT_THAT(Error(camera_, absl::StatusCode::kInvalidArgument), HasSubstr("EMVA1288_Data.txt"));
  Write("EMVA1288_Data.txt", "a diary\n");
  EXPECT_THAT(Error(camera_, absl::StatusCode::kInvalidArgument), HasSubstr("EMVA1288_Data.txt:1"));
  Write("EMVA1288_Data.txt", "n 12 640 480\n");
  fs::resize_file(camera_ + "/EMVA1288_Data.txt", (16 << 20) + 1);
  EXPECT_THAT(Error(camera_, absl::StatusCode::kInvalidArgument),
              HasSubstr("has 16777217 bytes, must have at most 16777216"));
}

}  // namespace
}  // namespace sightline
