// SPDX-License-Identifier: Apache-2.0
#include "core/sensor/emva1288_data.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using testing::AllOf;
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
  EXPECT_THAT(Reason("n 12 640 480\nb nan 2\n"), HasSubstr("camera.txt:2"));
  EXPECT_THAT(Reason("n 12 640 480\nb 1 inf\n"), HasSubstr("finite"));
  EXPECT_THAT(Reason("n 12 640\n"), HasSubstr("n BITS COLUMNS ROWS"));
  for (const char* number :
       {"012", "0x280", "6.4e2", "640.0", "+640", "-640", "99999999999", "nan"}) {
    for (const std::string& line :
         {absl::StrCat("n 12 ", number, " 480\n"), absl::StrCat("n ", number, " 640 480\n"),
          absl::StrCat("n 12 640 ", number, "\n")}) {
      EXPECT_THAT(Reason(line),
                  AllOf(HasSubstr("camera.txt:1: must be"), HasSubstr("whole number")))
          << line;
    }
  }
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

// A number is read in the one way that it has, or refused with its line.
TEST(Emva1288Data, NumbersWithTwoMeaningsAreRefused) {
  const auto time_ns = [](const std::string& number) {
    const auto set = ParseEmva1288Data("n 8 16 16\nd " + number + "\ni a\ni b\n", "camera.txt");
    return set.ok() ? 1e9 * set->steps(0).exposure_time_s() : -1;
  };
  for (const auto& [text, value] : {std::pair{"320000", 320000.0},
                                    {"320000.0", 320000.0},
                                    {"320.000", 320.0},
                                    {"12,5", 12.5},
                                    {"0,125", 0.125},
                                    {"1234,567", 1234.567},
                                    {"320,0000", 320.0},
                                    {"3.2e5", 320000.0}}) {
    EXPECT_NEAR(time_ns(text), value, 1e-9 * value) << text;
  }
  for (const char* text : {"320,000", "1,234", "-1,234", "1,234,567", "1.234,5", "1,234.5",
                           "1.234.567", "0x10", "nan", "inf", "1 000", "1'000", "", ","}) {
    EXPECT_THAT(Reason("n 8 16 16\nd " + std::string(text) + "\ni a\ni b\n"),
                HasSubstr("camera.txt:2"))
        << text;
    EXPECT_THAT(Reason("n 8 16 16\nb 1 " + std::string(text) + "x\ni a\ni b\n"),
                HasSubstr("camera.txt:2"))
        << text;
  }
  EXPECT_THAT(Reason("n 8 16 16\nb 320,000 961\ni a\ni b\n"),
              testing::AllOf(HasSubstr("exposure time is \"320,000\""), HasSubstr("two ways")));
  // A decimal comma elsewhere makes a point before three digits ambiguous.
  EXPECT_THAT(Reason("n 8 16 16\nd 320.000\ni a\ni b\nd 12,5\ni c\ni d\n"),
              testing::AllOf(HasSubstr("camera.txt:2"), HasSubstr("line 5")));
}

TEST(Emva1288Data, TheOrderOfLinesIsWithoutEffect) {
  // Two sweeps of the light, one with a filter, so that a longer exposure may have fewer photons.
  std::vector<std::string> steps = {"b 10 100\ni a1\ni a2\n", "b 20 200\ni b1\ni b2\n",
                                    "b 10 10\ni c1\ni c2\n",  "b 20 20\ni d1\ni d2\n",
                                    "b 20 20\ni e1\ni e2\n",  "d 10\ni f1\ni f2\n",
                                    "d 20\ni g1\ni g2\n"};
  std::sort(steps.begin(), steps.end());
  std::string first;
  int orders = 0;
  do {
    std::string text = "n 8 16 16\n";
    for (const std::string& step : steps) text += step;
    const auto set = ParseEmva1288Data(text, "camera.txt");
    ASSERT_TRUE(set.ok()) << set.status() << text;
    if (first.empty()) first = set->SerializeAsString();
    ASSERT_EQ(set->SerializeAsString(), first) << text;
  } while (++orders < 200 && std::next_permutation(steps.begin(), steps.end()));
  EXPECT_EQ(orders, 200);
}

TEST(Emva1288Data, TextForTheReportByteOrderMarksAndLineEndsAreRead) {
  const std::string set = "v 3.0\nn 8 16 16\nl InterfaceType Gigabit Ethernet\nd 1\ni a\ni b\n";
  const auto plain = ParseEmva1288Data(set, "camera.txt");
  ASSERT_TRUE(plain.ok()) << plain.status();
  std::string old_mac = set;
  std::replace(old_mac.begin(), old_mac.end(), '\n', '\r');
  for (const std::string& other : {"\xEF\xBB\xBF" + set, old_mac}) {
    const auto read = ParseEmva1288Data(other, "camera.txt");
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->SerializeAsString(), plain->SerializeAsString());
  }
  EXPECT_THAT(Reason(std::string("\xFF\xFEv\0", 4)), HasSubstr("byte order mark of UTF-16"));
  EXPECT_THAT(Reason(set + "\x1a\n"), HasSubstr("camera.txt:7"));
  EXPECT_THAT(Reason(set + std::string(1, '\0')), HasSubstr("camera.txt:7"));
  EXPECT_THAT(Reason("v\n"), HasSubstr("v VERSION"));
}

TEST(Emva1288Data, SamePhotonsForEveryExposureAreRemarked) {
  const auto remarks = [](const std::string& steps) {
    const auto set = ParseEmva1288Data("n 8 16 16\n" + steps, "camera.txt");
    EXPECT_TRUE(set.ok()) << set.status();
    return SensorSetRemarks(*set);
  };
  EXPECT_THAT(remarks("b 10 500\ni a\ni b\nb 20 500\ni c\ni d\n"),
              testing::ElementsAre(HasSubstr("same 500 photons")));
  EXPECT_THAT(remarks("b 10 500\ni a\ni b\nb 20 600\ni c\ni d\n"), testing::IsEmpty());
  EXPECT_THAT(remarks("b 10 500\ni a\ni b\nb 10 500\ni c\ni d\n"), testing::IsEmpty());
  EXPECT_THAT(remarks("b 10\ni a\ni b\nb 20\ni c\ni d\n"), testing::IsEmpty());
}

}  // namespace
}  // namespace sightline
