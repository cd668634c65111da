// SPDX-License-Identifier: Apache-2.0
#include "planner_client/measured_points/read_points.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

constexpr int64_t kMany = 1000;

class ReadPointsTest : public testing::Test {
 protected:
  ReadPointsTest()
      : folder_(std::filesystem::temp_directory_path() /
                absl::StrCat("read_points_", getpid(), "_",
                             testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::create_directories(folder_);
    // The laser looks along +y of the part and moves along its x.
    frame_.laser_at = [](double stage_m) {
      Eigen::Matrix4d matrix;
      matrix << 0, 1, 0, stage_m, 0, 0, 1, 0.5, 1, 0, 0, 0, 0, 0, 0, 1;
      return Eigen::Isometry3d(matrix);
    };
  }
  ~ReadPointsTest() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& bytes) const {
    const std::string path = (folder_ / name).string();
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }
  absl::StatusOr<MeasuredPoints> Read(const std::string& path) const {
    return ReadMeasuredPoints(path, frame_, kMany);
  }
  static std::string Floats(std::initializer_list<float> values) {
    std::string bytes;
    for (const float value : values) {
      char word[4];
      std::memcpy(word, &value, 4);
      bytes.append(word, 4);
    }
    return bytes;
  }
  static bool Says(const absl::Status& status, const std::string& text) {
    return std::string(status.message()).find(text) != std::string::npos;
  }

  std::filesystem::path folder_;
  PointFileFrame frame_;
};

TEST_F(ReadPointsTest, ProfilesLieInThePlaneOfTheLaser) {
  const auto points = Read(Write("scan_01.csv",
                                 "profile,stage_mm,x_mm,z_mm\n0,10,1,300\n0,10,2,301.5\n"
                                 "1,10.5,-1,299\n"));
  ASSERT_TRUE(points.ok()) << points.status();
  ASSERT_EQ(points->cloud.positions_m.size(), 3u);
  EXPECT_TRUE(points->cloud.positions_m[1].isApprox(Eigen::Vector3d(0.01, 0.8015, 0.002), 1e-12));
  EXPECT_TRUE(points->cloud.positions_m[2].isApprox(Eigen::Vector3d(0.0105, 0.799, -0.001), 1e-12));
  // Decimal commas.
  const auto commas =
      Read(Write("scan_02.csv", "stage_mm;x_mm;z_mm\n10,5;-1,25;299\n1,5;0,5;1,5\n"));
  ASSERT_TRUE(commas.ok()) << commas.status();
  EXPECT_NEAR(commas->cloud.positions_m[0].z(), -0.00125, 1e-12);
}

TEST_F(ReadPointsTest, ProfilesWithoutUnitColumnOrNumberAreNamed) {
  const auto unit = Read(Write("a.csv", "stage_mm,x,z_mm\n1,2,3\n"));
  EXPECT_TRUE(Says(unit.status(), "a.csv: column x states no unit")) << unit.status();
  const auto column = Read(Write("b.csv", "stage_mm,x_mm\n1,2\n"));
  EXPECT_TRUE(Says(column.status(), "b.csv: its first line has no column z")) << column.status();
  const auto number = Read(Write("c.csv", "stage_mm,x_mm,z_mm\n1,2,3\n1,nan,3\n"));
  EXPECT_TRUE(Says(number.status(), "c.csv, line 3")) << number.status();
  const auto none = Read(Write("d.csv", "stage_mm,x_mm,z_mm\n"));
  EXPECT_TRUE(Says(none.status(), "d.csv")) << none.status();
}

constexpr char kPcdHead[] =
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\n"
    "COUNT 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n";

TEST_F(ReadPointsTest, PcdAsTextAndBinaryIsTheSame) {
  frame_.metres_per_unit = 1e-3;
  const auto text = Read(
      Write("a.pcd", absl::StrCat(kPcdHead, "DATA ascii\n1 2 3 9\nnan nan nan 0\n4 5 6.5 9\n")));
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_EQ(text->without_value, 1);
  ASSERT_EQ(text->cloud.positions_m.size(), 2u);
  EXPECT_TRUE(text->cloud.positions_m[1].isApprox(Eigen::Vector3d(0.004, 0.005, 0.0065), 1e-9));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto binary =
      Read(Write("b.pcd", absl::StrCat(kPcdHead, "DATA binary\n",
                                       Floats({1, 2, 3, 9, nan, nan, nan, 0, 4, 5, 6.5f, 9}))));
  ASSERT_TRUE(binary.ok()) << binary.status();
  EXPECT_EQ(binary->cloud.positions_m, text->cloud.positions_m);
  EXPECT_EQ(binary->without_value, 1);
}

// Values of a field follow one another; here as literals, and the zeros as a reference back.
TEST_F(ReadPointsTest, CompressedPcdIsTheSame) {
  const std::string fields = Floats({1, 1, 1, 2, 2, 2, 3, 3, 3, 0, 0, 0});
  std::string packed;
  for (size_t i = 0; i < 36; i += 18) packed += std::string(1, 17) + fields.substr(i, 18);
  // A literal zero, then a reference of 11 bytes to the byte before.
  packed += std::string(1, 0) + std::string(1, '\0');
  packed += std::string(1, static_cast<char>(7 << 5)) + std::string(1, 2) + std::string(1, 0);
  const auto length = [](uint32_t n) {
    char word[4];
    std::memcpy(word, &n, 4);
    return std::string(word, 4);
  };
  const std::string file =
      absl::StrCat(kPcdHead, "DATA binary_compressed\n",
                   length(static_cast<uint32_t>(packed.size())), length(48), packed);
  const auto points = Read(Write("c.pcd", file));
  ASSERT_TRUE(points.ok()) << points.status();
  ASSERT_EQ(points->cloud.positions_m.size(), 3u);
  for (const Eigen::Vector3d& p : points->cloud.positions_m) EXPECT_EQ(p, Eigen::Vector3d(1, 2, 3));
  const auto cut = Read(Write("d.pcd", file.substr(0, file.size() - 2)));
  EXPECT_TRUE(Says(cut.status(), "d.pcd: PCD: its compressed data are damaged")) << cut.status();
}

TEST_F(ReadPointsTest, DamagedPcdIsNamed) {
  const auto cut = Read(Write("a.pcd", absl::StrCat(kPcdHead, "DATA binary\n", "1234")));
  EXPECT_TRUE(Says(cut.status(), "a.pcd: PCD: has 4 bytes")) << cut.status();
  const auto bare = Read(Write("b.pcd", "VERSION 0.7\n"));
  EXPECT_TRUE(Says(bare.status(), "no line DATA")) << bare.status();
  std::string many = kPcdHead;
  many.replace(many.find("POINTS 3"), 8, "POINTS 99999999999");
  const auto too_many = Read(Write("c.pcd", many + "DATA binary\n"));
  EXPECT_TRUE(Says(too_many.status(), "at most 1000")) << too_many.status();
}

TEST_F(ReadPointsTest, OtherFormatsAreRefusedWithAdvice) {
  const auto e57 = Read(Write("a.e57", "x"));
  EXPECT_TRUE(Says(e57.status(), "export the points as PLY")) << e57.status();
  const auto other = Read(Write("a.xyz", "x"));
  EXPECT_TRUE(Says(other.status(), "pcd")) << other.status();
  EXPECT_EQ(Read((folder_ / "none.pcd").string()).status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace sightline
