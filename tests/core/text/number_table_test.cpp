// SPDX-License-Identifier: Apache-2.0
#include "core/text/number_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using Rows = std::vector<std::vector<double>>;

absl::StatusOr<Rows> Read(const std::string& text, const NumberTableRules& rules = {}) {
  Rows rows;
  const absl::Status status =
      ReadNumberTable(text, rules, "t.txt", {}, [&](int, const std::vector<double>& values) {
        rows.push_back(values);
        return absl::OkStatus();
      });
  if (!status.ok()) return status;
  return rows;
}

std::string ErrorOf(const std::string& text, const NumberTableRules& rules = {}) {
  const auto rows = Read(text, rules);
  return rows.ok() ? "read" : std::string(rows.status().message());
}

// Every pair of separator and decimal sign that is written in practice: read back or refused, never
// read as other numbers.
TEST(NumberTable, ATableIsReadAsItWasWrittenOrRefused) {
  const Rows tables[] = {{{0.8956, -0.0431, 12.5}, {1.25, 0.5, -3.125}},
                         {{1, 2, 3}, {4, 5, 6}},
                         {{1.5, 2, 1.25}, {3, -4, 5}},
                         {{1.234, 5.678}, {2.345, 6.789}},
                         {{0.1}, {0.25}},
                         {{1234.5, 0.001}, {7, 8}}};
  int read = 0;
  for (const Rows& table : tables) {
    for (const std::string separator : {"\t", " ", ";", ",", "; ", ", ", "  ", ";\t"}) {
      for (const char decimal : {'.', ','}) {
        std::string text;
        for (const std::vector<double>& row : table) {
          std::vector<std::string> cells;
          for (const double value : row) {
            std::string cell = absl::StrCat(value);
            const size_t point = cell.find('.');
            if (point != std::string::npos) cell[point] = decimal;
            cells.push_back(cell);
          }
          absl::StrAppend(&text, absl::StrJoin(cells, separator), "\n");
        }
        const auto rows = Read(text);
        if (!rows.ok()) continue;
        ++read;
        // No rule can distinguish commas that separate values from decimal ones if nothing but
        // digits is between them in every line; such tables differ in their number of columns.
        if (decimal == ',' && separator[0] == ',' && (*rows)[0].size() != table[0].size()) continue;
        EXPECT_EQ(*rows, table) << text;
      }
    }
  }
  EXPECT_GT(read, 50);
}

TEST(NumberTable, DecimalCommasBetweenTabsOrSemicolons) {
  EXPECT_EQ(*Read("0,8956\t0,8596\t12\n-0,0431\t1\t2,5\n"),
            (Rows{{0.8956, 0.8596, 12}, {-0.0431, 1, 2.5}}));
  EXPECT_EQ(*Read("0,5;1,25\n2;3,5e-3\n"), (Rows{{0.5, 1.25}, {2, 0.0035}}));
  EXPECT_EQ(*Read("600;1,2;6,5\n", {.columns = {"wavelength_nm", "n", "k"}}),
            (Rows{{600, 1.2, 6.5}}));
}

TEST(NumberTable, TablesThatCanBeReadInTwoWaysAreRefused) {
  for (const std::string text : {
           "0,5 1,5\n0,25 3\n",             // blanks and commas both separate, or decimals
           "1,500\t2,250\n3,125\t4,750\n",  // thousands or decimals
           "0,8956,0,0596\n",               // 0596 is no whole number that anybody writes
           "-0,5,1,5\n",                    // nor is -0
           "0,5\n0,75\n",                   // one column or two
           "1,2, 3,4\n",                    // 1.2, 3.4 or four values
           "1.234,567\n",                   // one value with points between thousands, or two
           "1.234,5\n0,25\n12,75\n",        // likewise in each line
           "-1.234,5e2\n-2.345,6e2\n",      // likewise
           "1,234.5\n12,345.25\n",          // one value with commas between thousands, or two
       }) {
    EXPECT_THAT(ErrorOf(text), HasSubstr("t.txt: the table can be read in two ways")) << text;
  }
  for (const std::string text : {
           "1.5\t2,5\n",        // points and commas
           "1.234,5\t2,5\n",    // thousands with points
           "1,234,567\t2,5\n",  // thousands with commas
           "1;2 3\n",           // semicolons and blanks
           "0 1 2\n3, 4, 5\n",  // blanks and commas
       }) {
    EXPECT_NE(ErrorOf(text), "read") << text;
  }
}

// One line that cannot be one number decides it, and so do the names of the columns.
TEST(NumberTable, PointsAndCommasThatCanBeReadInOneWayAreRead) {
  EXPECT_EQ(*Read("1.234,567\n1.5,2\n"), (Rows{{1.234, 567}, {1.5, 2}}));
  EXPECT_EQ(*Read("0.234,567\n"), (Rows{{0.234, 567}}));
  EXPECT_EQ(*Read("1,234.5\n2,34.5\n"), (Rows{{1, 234.5}, {2, 34.5}}));
  EXPECT_EQ(*Read("123,124,125\n124,9,125\n"), (Rows{{123, 124, 125}, {124, 9, 125}}));
  EXPECT_EQ(*Read("100,101,102,103,104,105\n"), (Rows{{100, 101, 102, 103, 104, 105}}));
  EXPECT_EQ(*Read("1.234,567\n", {.columns = {"a", "b"}}), (Rows{{1.234, 567}}));
}

TEST(NumberTable, UsualTablesAreRead) {
  const Rows expected = {{1, 2, 3}, {4, 5.5, 6}};
  for (const std::string text : {
           "1 2 3\n4 5.5 6\n",
           "1\t2\t3\n4\t5.5\t6\n",
           "1,2,3\n4,5.5,6\n",
           "1, 2, 3\n4, 5.5, 6\n",
           "1;2;3\n4;5.5;6\n",
           "1\t2\t3\t\r\n4\t5.5\t6\t\r\n",  // a tab ends every line
           "1,2,3,\n4,5.5,6,\n",
           " 1  2 3\n 4  5.5 6",
           "1 2 3\r4 5.5 6\r",
           "\n1 2 3\n\n4 5.5 6\n\n",
           "\xef\xbb\xbf"
           "1 2 3\n4 5.5 6\n",
           "1 2 3\n4 5.5 6\n\x1a",
           "+1 2e0 3.\n4 55e-1 6\n",
       }) {
    const auto rows = Read(text);
    ASSERT_TRUE(rows.ok()) << rows.status() << "\n" << text;
    EXPECT_EQ(*rows, expected) << text;
  }
  EXPECT_EQ(*Read("120,131,140\n121,130,139\n"), (Rows{{120, 131, 140}, {121, 130, 139}}));
}

TEST(NumberTable, ErrorsNameLineAndColumn) {
  EXPECT_THAT(ErrorOf("1\t2\n3\tx\n"), HasSubstr("t.txt, line 2, column 2: not a number"));
  EXPECT_THAT(ErrorOf("1\t2\n3\tnan\n"), HasSubstr("line 2, column 2: not a number"));
  EXPECT_THAT(ErrorOf("1\t2\n3\t1e999\n"), HasSubstr("line 2, column 2: not a number"));
  EXPECT_THAT(ErrorOf("1\t2\n3\t0x10\n"), HasSubstr("line 2, column 2: not a number"));
  EXPECT_THAT(ErrorOf("1\t\t2\n3\t4\t5\n"), HasSubstr("line 1, column 2: is empty"));
  EXPECT_THAT(ErrorOf("1,2.5,3\n4,,5\n"), HasSubstr("line 2, column 2: is empty"));
  EXPECT_THAT(ErrorOf("1 2\nHeights, in um; by hand\n"), HasSubstr("line 2: not numbers"));
  EXPECT_THAT(ErrorOf("1 2\n3\n"), HasSubstr("line 2 has 1 values, the lines before have 2"));
  EXPECT_THAT(ErrorOf("\n \n"), HasSubstr("holds no values"));
  EXPECT_THAT(ErrorOf("1 2 3\n", {.max_numbers = 2}), HasSubstr("more than 2 numbers"));
  EXPECT_THAT(ErrorOf(std::string("\xff\xfe\x31\0 \0", 6)), HasSubstr("UTF-16"));
}

TEST(NumberTable, NamedColumns) {
  const NumberTableRules rules{.columns = {"a", "b"}, .comments = true};
  EXPECT_EQ(*Read("# by hand\na,b\n1,2\n#\n3,4\n", rules), (Rows{{1, 2}, {3, 4}}));
  EXPECT_EQ(*Read("a;b\n0,5;2\n", rules), (Rows{{0.5, 2}}));
  EXPECT_EQ(*Read("1,2\n", rules), (Rows{{1, 2}}));
  EXPECT_THAT(ErrorOf("b,a\n1,2\n", rules), HasSubstr("the columns are a,b"));
  EXPECT_THAT(ErrorOf("0,5,1,5\n", rules), HasSubstr("line 1 has 4 values, must have a,b"));
}

}  // namespace
}  // namespace sightline
