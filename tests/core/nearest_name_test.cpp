#include "core/text/nearest_name.h"

#include <gtest/gtest.h>

#include <array>

namespace sightline {
namespace {

constexpr std::array<std::string_view, 4> kNames = {"camera", "lens", "laser", "lasers"};

TEST(NearestName, HasTheLeastEditDistance) {
  EXPECT_EQ(NearestName("camra", kNames), "camera");   // one left out
  EXPECT_EQ(NearestName("lensx", kNames), "lens");     // one too many
  EXPECT_EQ(NearestName("lsaers", kNames), "lasers");  // two exchanged
  EXPECT_EQ(NearestName("laser", kNames), "laser");
}

TEST(NearestName, TakesTheFirstOfEquals) {
  constexpr std::array<std::string_view, 2> kEqual = {"ab", "cb"};
  EXPECT_EQ(NearestName("bb", kEqual), "ab");
}

TEST(NearestName, IsEmptyWhereNothingIsKnown) { EXPECT_EQ(NearestName("camera", {}), ""); }

TEST(NearestName, LooksAtTheBeginningOfAbsurdNames) {
  EXPECT_EQ(NearestName("camera" + std::string(10'000'000, 'x'), kNames), "camera");
}

}  // namespace
}  // namespace sightline
