// SPDX-License-Identifier: Apache-2.0
#include "core/sensor/emva1288_data.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace sightline {
namespace {

using testing::HasSubstr;

constexpr char kSet[] =
    "# a camera\r\n"
    "v 3.0\r\n"
    "n 12 640 480\r\n"
    "b 40000.0 120,5\r\n"
    "i images\\b 0.png\r\n"
    "i images\\b_1.png\r\n"
    "\r\n"
    "d 40000\r\n"
    "i images/d_0.png\r\n"
    "i images/d_1.png\r\n";

std::string Reason(const std::string& text) {
  const auto set = ParseEmva1288Data(text, "camera.txt");
  EXPECT_FALSE(set.ok()) << text;
  return std::string(set.status().message());
}

TEST(Emva1288Data, ReadsStepsInSiUnitsAndPathsOfBothKinds) {
  const auto set = ParseEmva1288Data(kSet, "camera.txt");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->bit_depth_bit(), 12);
  EXPECT_EQ(set->columns_px(), 640);
  EXPECT_EQ(set->rows_px(), 480);
  ASSERT_EQ(set->steps_size(), 2);
  EXPECT_FALSE(set->steps(0).dark());
  EXPECT_DOUBLE_EQ(set->steps(0).exposure_time_s(), 40e-6);
  EXPECT_DOUBLE_EQ(set->steps(0).photons(), 120.5);
  EXPECT_EQ(set->steps(0).files(0), "images/b 0.png");
  EXPECT_TRUE(set->steps(1).dark());
  EXPECT_FALSE(set->steps(1).has_photons());
}

TEST(Emva1288Data, PhotonsMayBeMissingInAllSteps) {
  const auto set = ParseEmva1288Data("n 8 16 16\nb 10\ni a\ni b\nb 20\ni c\ni d\n", "camera.txt");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_FALSE(set->steps(0).has_photons());
  EXPECT_THAT(Reason("n 8 16 16\nb 10\ni a\ni b\nb 20 5\ni c\ni d\n"), HasSubstr("all steps"));
}

TEST(Emva1288Data, ErrorsNameFileLineAndReason) {
  EXPECT_THAT(Reason("n 12 640 480\nb 1 2\ni a\nd 1\ni b\ni c\n"),
              testing::AllOf(HasSubstr("camera.txt:2"), HasSubstr("1 image,")));
  EXPECT_THAT(
      Reason("n 12 640 480\nb 1 200\ni a\ni b\nb 2 100\ni c\ni d\n"),
      testing::AllOf(HasSubstr("camera.txt:5"), HasSubstr("photons fall from 200 (line 2)")));
  EXPECT_THAT(Reason("n 12 640 480\nb nan 2\n"), HasSubstr("camera.txt:2"));
  EXPECT_THAT(Reason("n 12 640 480\nb 1 inf\n"), HasSubstr("finite"));
  EXPECT_THAT(Reason("n 12 640\n"), HasSubstr("n BITS COLUMNS ROWS"));
  EXPECT_THAT(Reason("n 12 640 480\ni a\n"), HasSubstr("below a line"));
  EXPECT_THAT(Reason("n 12 640 480\nx a\n"), HasSubstr("begins with \"x\""));
  EXPECT_THAT(Reason("n 17 640 480\nd 1\ni a\ni b\n"), HasSubstr("bit_depth_bit is 17"));
  EXPECT_THAT(Reason("n 12 640 2\nd 1\ni a\ni b\n"), HasSubstr("rows_px is 2"));
  EXPECT_THAT(Reason("d 1\ni a\ni b\n"), HasSubstr("no line \"n"));
  EXPECT_THAT(Reason("n 12 640 480\nd 1\ni a\ni a\n"), HasSubstr("second time"));
  EXPECT_THAT(Reason("n 12 640 480\nd -1\ni a\ni b\n"), HasSubstr("exposure_time_s"));
  EXPECT_THAT(Reason("n 12 640 480\n"), HasSubstr("number of steps is 0"));
  EXPECT_THAT(Reason("\x01\x02\n"), HasSubstr("begins with"));
}

}  // namespace
}  // namespace sightline
