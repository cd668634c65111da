// SPDX-License-Identifier: Apache-2.0
#include "core/text/length_unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace sightline {
namespace {

TEST(LengthUnit, SpellingsThatPeopleUse) {
  const std::vector<std::pair<std::string, double>> metres = {
      {"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"inch", 0.0254}};
  const std::vector<std::pair<std::string, std::string>> spellings = {
      {"in", "inch"},  {"IN", "inch"},       {"\"", "inch"},        {"Inches", "inch"},
      {"MM", "mm"},    {"Millimetre", "mm"}, {"millimeters", "mm"}, {"cm", "cm"},
      {"metres", "m"}, {"\u00b5m", "um"},    {"micron", "um"},      {"\u2033", "inch"}};
  for (const auto& [name, factor] : metres) {
    EXPECT_EQ(LengthUnitNamed(name).value(), name);
    EXPECT_EQ(MetresPerUnit(name), factor) << name;
  }
  for (const auto& [spelling, name] : spellings) {
    EXPECT_EQ(LengthUnitNamed(spelling).value(), name) << spelling;
    EXPECT_EQ(MetresPerUnit(spelling), MetresPerUnit(name)) << spelling;
  }
}

TEST(LengthUnit, OthersAreRefused) {
  // A megametre is no millimetre.
  for (const char* text : {"", "Mm", "yard", "mm ", "0.001", "'", "k", "INCHE"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(LengthUnitNamed(text).status())) << text;
    EXPECT_FALSE(MetresPerUnit(text).has_value()) << text;
  }
  EXPECT_THAT(LengthUnitNamed("yard").status().message(),
              testing::AllOf(testing::HasSubstr("mm"), testing::HasSubstr("\"yard\"")));
}

}  // namespace
}  // namespace sightline
