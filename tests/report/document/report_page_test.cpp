// SPDX-License-Identifier: Apache-2.0
#include "report/document/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "absl/strings/str_replace.h"
#include "core/json/strict_json.h"
#include "report/document/report_parts.h"
#include "tests/report/report_reading.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::Report ReportSaying(const std::string& text) {
  v1::Report report;
  report.set_title(text);
  report.set_kind("test");
  report.set_heading(text);
  AddSection(&report, "words", text,
             {TextBlock(text), TableBlock(text, {WordsColumn(text), NumberColumn("number", "mm")},
                                          {{TextCell(text), NumberCell(1.0 / 3, "0.333")}})});
  return report;
}

// The JSON in the page.
std::string DataOf(const std::string& page) {
  const std::string mark = "id=\"report-data\">";
  const size_t begin = page.find(mark) + mark.size();
  return page.substr(begin, page.find("</script>", begin) - begin);
}

TEST(ReportPage, HoldsTheWholeReport) {
  const v1::Report report = ReportSaying("a text");
  v1::Report read;
  ASSERT_TRUE(ParseStrictJson(DataOf(ReportPage(report, "report.json")), "page", &read).ok());
  EXPECT_EQ(ToJson(read), ToJson(report));
  EXPECT_EQ(TablesOf(read)[0].rows(0).cells(1).number(), 1.0 / 3);
}

TEST(ReportPage, TextsAreNeverMarkup) {
  const std::string text = "</script><script>alert('x')</script><!-- {{SCRIPT}} &\"";
  const v1::Report report = ReportSaying(text);
  const std::string page = ReportPage(report, "report.json");
  const size_t of_harmless_page =
      CountOf(ReportPage(ReportSaying("a text"), "report.json"), "<script");
  EXPECT_EQ(CountOf(page, "<script"), of_harmless_page);
  EXPECT_THAT(DataOf(page), Not(HasSubstr("<")));
  v1::Report read;
  ASSERT_TRUE(ParseStrictJson(DataOf(page), "page", &read).ok());
  EXPECT_EQ(read.heading(), text);
}

TEST(ReportPage, LoadsNothingFromAnywhere) {
  const std::string page = ReportPage(ReportSaying("a text"), "report.json");
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  // The name of SVG is no address.
  const std::string rest = absl::StrReplaceAll(page, {{"http://www.w3.org/2000/svg", ""}});
  for (const char* address : {"http://", "https://", "@import", "url(", "src=\"", "fetch("}) {
    EXPECT_THAT(rest, Not(HasSubstr(address)));
  }
}

TEST(ReportPage, NamesItsDataToReadersWithoutScripts) {
  EXPECT_THAT(ReportPage(ReportSaying("a text"), "optics_report.json"),
              HasSubstr("Its data are in the file optics_report.json beside it."));
}

TEST(ReportDataPath, StandsBesideThePage) {
  EXPECT_EQ(ReportDataPath("/a/b/report.html"), "/a/b/report.json");
  EXPECT_EQ(ReportDataPath("optics.html"), "optics_report.json");
}

TEST(ReportParts, NumbersKeepTheirUnitAndPrecision) {
  const v1::ReportCell length = QuantityCell("width_m", 0.00012345678);
  EXPECT_EQ(length.text(), "0.123\u202fmm");
  EXPECT_EQ(length.number(), 0.00012345678);
  EXPECT_EQ(length.unit(), "m");
  const v1::ReportCell part = QuantityCell("coverage_fraction", 0.25);
  EXPECT_EQ(part.number(), 25);
  EXPECT_EQ(part.unit(), "%");
  const v1::ReportCell unknown = QuantityCell("width_m", NAN);
  EXPECT_EQ(unknown.text(), "\u2013");
  EXPECT_FALSE(unknown.has_number());
}

}  // namespace
}  // namespace sightline
