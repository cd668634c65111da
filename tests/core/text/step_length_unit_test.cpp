// SPDX-License-Identifier: Apache-2.0
// The scan may say that a STEP file states no length unit only if none of its contexts refers to
// one, however the file is written and cut into pieces.
#include "core/text/step_length_unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace sightline {
namespace {

bool StatesNone(const std::string& text, size_t piece_bytes = 1 << 20) {
  StepLengthUnitScan scan;
  for (size_t at = 0; at < text.size(); at += piece_bytes) {
    scan.Add(std::string_view(text).substr(at, piece_bytes));
  }
  return scan.StatesNone();
}

std::string FileOf(const std::string& data) {
  return absl::StrCat("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('a; #1=LENGTH_UNIT()'),'2;1');\n",
                      "ENDSEC;\nDATA;\n", data, "ENDSEC;\nEND-ISO-10303-21;\n");
}

constexpr char kContext[] =
    "#10=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#21,#22))"
    "REPRESENTATION_CONTEXT('ID','3'));\n";
constexpr char kMillimetre[] = "#21=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));\n";
constexpr char kRadian[] = "#22=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));\n";

TEST(StepLengthUnitScan, FindsUnitsHoweverTheyAreWritten) {
  const std::string context = kContext, radian = kRadian;
  const std::vector<std::string> stated = {
      context + kMillimetre + radian,
      // Units may stand before their context.
      kMillimetre + radian + context,
      context + radian + "#21 = SI_UNIT(*,$,.METRE.);\n",
      context + radian + "#21=(CONVERSION_BASED_UNIT('INCH',#30)LENGTH_UNIT()NAMED_UNIT(#31));\n",
      absl::StrReplaceAll(context, {{"#21", "\n  #21\n"}}) + kMillimetre,
      absl::StrReplaceAll(context, {{"#21", "/* ' \" */#21/**/"}}) + kMillimetre,
      absl::StrReplaceAll(context, {{"'ID'", "'it''s; '"}}) + kMillimetre,
      absl::StrReplaceAll(context, {{"'ID'", "\"0F';\""}}) + kMillimetre,
      "/*/ #21=(; */" + context + kMillimetre,
  };
  for (const std::string& data : stated) {
    for (const size_t piece : {size_t{1}, size_t{7}, size_t{1} << 20}) {
      EXPECT_FALSE(StatesNone(FileOf(data), piece)) << data;
    }
  }
}

TEST(StepLengthUnitScan, KnowsThatNoContextHasOne) {
  const std::string context = kContext, radian = kRadian;
  const std::vector<std::string> not_stated = {
      "#10=(GEOMETRIC_REPRESENTATION_CONTEXT(3)REPRESENTATION_CONTEXT('',''));\n",
      absl::StrReplaceAll(context, {{"#21,", ""}}) + radian,
      // A unit that no context refers to is that of something else.
      absl::StrReplaceAll(context, {{"#21,", ""}}) + kMillimetre + radian,
      absl::StrReplaceAll(context, {{"#21", "#210"}}) + kMillimetre + radian +
          "#210=(MASS_UNIT());\n",
      // Words in strings and comments state nothing.
      context + radian + "#21=DESCRIPTIVE_ITEM('LENGTH_UNIT() .METRE.','it''s METRE');\n",
      absl::StrReplaceAll(context, {{"#21,", ""}}) + radian + "/* #21=(LENGTH_UNIT()); */\n",
      absl::StrReplaceAll(context, {{"#21,", ""}}) + radian + "/*/ #21=(LENGTH_UNIT()); a/*/\n",
      context + radian + "#21=(NAMED_UNIT(*)MASS_UNIT()SI_UNIT(.KILO.,.GRAM.));\n",
  };
  for (const std::string& data : not_stated) {
    for (const size_t piece : {size_t{1}, size_t{7}, size_t{1} << 20}) {
      EXPECT_TRUE(StatesNone(FileOf(data), piece)) << data;
    }
  }
}

// A file whose damage is what is wrong with it is not blamed for its unit.
TEST(StepLengthUnitScan, SaysNothingOfDamagedFiles) {
  const std::string data = std::string(kContext) + kRadian + "#21=(MASS_UNIT()NAMED_UNIT(*));\n";
  const std::string whole = FileOf(data);
  ASSERT_TRUE(StatesNone(whole));
  for (const std::string& damaged : {
           FileOf(absl::StrReplaceAll(data, {{"#21=", "#210="}})),  // its context dangles
           FileOf(data + "#30=ADVANCED_FACE('',(#31),#31,.T.);\n"),
           std::string("\x7f"
                       "ELF\x02\x01\x01") +
               "#1=(;#2;" + std::string(4096, 'x') + whole,
           absl::StrReplaceAll(whole, {{"END-ISO-10303-21;", ""}}),
       }) {
    EXPECT_FALSE(StatesNone(damaged)) << damaged.substr(0, 200);
  }
}

TEST(StepLengthUnitScan, KnowsThatEveryShapeHasAUnit) {
  const auto states_all = [](const std::string& data) {
    StepLengthUnitScan scan;
    scan.Add(FileOf(data));
    return scan.StatesAll();
  };
  const std::string with_unit = std::string(kContext) + kMillimetre + kRadian;
  const std::string without =
      absl::StrReplaceAll(std::string(kContext), {{"#10=", "#11="}, {"#21,", ""}});
  EXPECT_TRUE(states_all(with_unit));
  EXPECT_TRUE(states_all(std::string(kMillimetre) + kRadian + kContext));
  // Curves in parameter space have no unit.
  EXPECT_TRUE(states_all(with_unit +
                         "#12=(GEOMETRIC_REPRESENTATION_CONTEXT(2)"
                         "PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('',''));\n"));
  EXPECT_FALSE(states_all(with_unit + without));
  EXPECT_FALSE(states_all(with_unit + "#30=ADVANCED_FACE('',(#31),#31,.T.);\n"));
  EXPECT_FALSE(states_all("#1=PRODUCT('p','p','',());\n"));
}

TEST(StepLengthUnitScan, SaysNothingOfTextThatItCannotTell) {
  EXPECT_FALSE(StatesNone(""));
  EXPECT_FALSE(StatesNone("solid part"));
  EXPECT_FALSE(StatesNone(FileOf("")));
  const std::string none = FileOf("#1=PRODUCT('p','p','',());\n");
  ASSERT_TRUE(StatesNone(none));
  EXPECT_FALSE(StatesNone(none + "'"));
  EXPECT_FALSE(StatesNone(none + "/* "));
  std::string many;
  for (int i = 0; i < 150'000; ++i) absl::StrAppend(&many, "#", i + 1, "=LENGTH_UNIT();\n");
  EXPECT_FALSE(StatesNone(FileOf(many)));
}

}  // namespace
}  // namespace sightline
