// SPDX-License-Identifier: Apache-2.0
#include "report/optics/optics_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "core/json/strict_json.h"
#include "report/document/report_page.h"
#include "report/optics/optics_charts.h"
#include "report/optics/optics_text.h"
#include "tests/report/optics/sample_optics.h"
#include "tests/report/report_reading.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

using Mark = v1::ReportSeries;

v1::Report Made(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices = nullptr) {
  v1::Report report = OpticsReport(optics, devices);
  EXPECT_EQ(ReportFault(report), "");
  return report;
}

OpticsCurve CurveOf(const v1::OpticsPlan& optics) {
  OpticsCurve curve;
  for (const v1::OpticsPoint& point : optics.curve()) curve.points.push_back(&point);
  curve.best = &optics.best();
  curve.longest_exposure_time_s = optics.common().longest_exposure_time_s();
  return curve;
}

v1::ReportFact FigureOf(const v1::Report& report, const std::string& name) {
  for (const v1::ReportFact& fact : report.figures()) {
    if (fact.name() == name) return fact;
  }
  ADD_FAILURE() << "no figure " << name;
  return {};
}

// Series of any mark in this colour.
int SeriesIn(const v1::ReportChart& chart, v1::ReportColour colour) {
  int count = 0;
  for (const v1::ReportSeries& series : chart.series()) count += series.colour() == colour ? 1 : 0;
  return count;
}

TEST(OpticsReport, LeadsWithTheSetting) {
  const v1::Report report = Made(SampleOptics());
  EXPECT_EQ(report.heading(), "f/2.8, 9.408\u202fms, focus 600\u202fmm, laser 5\u202fmW");
  EXPECT_THAT(report.finding(0).text(), HasSubstr("f/2.8 and f/4 cannot be told apart"));
  const v1::ReportFact scatter = FigureOf(report, "scatter of the line, u\u209a\u2093");
  EXPECT_EQ(scatter.text(), "0.189\u202fpx");
  EXPECT_THAT(scatter.detail(), HasSubstr("0.170\u202f\u2026\u202f0.227\u202fpx"));
  EXPECT_EQ(scatter.number(), SampleOptics().best().u_px());
  EXPECT_EQ(scatter.unit(), "px");
  const v1::ReportFact real = FigureOf(report, "u\u209a\u2093 expected of the real camera");
  EXPECT_EQ(real.text(), "0.223\u202fpx");
  EXPECT_THAT(real.detail(), HasSubstr("0.189\u202f\u2026\u202f0.284\u202fpx"));
  const v1::ReportFact detected = FigureOf(report, "detected part of the line");
  EXPECT_EQ(detected.text(), "92.9\u202f%");
  EXPECT_THAT(detected.detail(), HasSubstr("89.9\u202f\u2026\u202f93.9\u202f%"));
  EXPECT_EQ(FigureOf(report, "cost").text(), "0.389\u202fpx");
  EXPECT_EQ(FigureOf(report, "false lines per column").text(), "0.0034");
  EXPECT_EQ(FigureOf(report, "time of all scans").text(), "41.5\u202fs");
  EXPECT_THAT(report.warnings(0), HasSubstr("The lens has no catalogued transmission"));
}

TEST(OpticsReport, NamesWhatElseIsSet) {
  v1::OpticsPlan optics = SampleOptics();
  v1::OpticalSetting* setting = optics.mutable_best()->mutable_setting();
  setting->set_second_exposure_time_s(0.0005);
  setting->set_sensor_tilt_x_deg(2.1);
  EXPECT_EQ(Made(optics).heading(),
            "f/2.8, 9.408\u202fms and 0.5\u202fms, focus 600\u202fmm, laser 5\u202fmW, sensor "
            "tilted by 2.1\u00b0 about its rows");
  // In the table only what some f-number has of its own.
  EXPECT_THAT(TextOf(SectionOf(Made(optics), "curve")), Not(HasSubstr("further")));
  *optics.mutable_curve(2)->mutable_setting() = optics.best().setting();
  optics.mutable_curve(4)->mutable_setting()->set_laser_power_w(0.001);
  const std::string table = TextOf(SectionOf(Made(optics), "curve"));
  EXPECT_THAT(table, HasSubstr("second exposure 0.5\u202fms, laser 5\u202fmW, sensor tilted by "
                               "2.1\u00b0 about its rows\n"));
  EXPECT_THAT(table, HasSubstr("\nlaser 1\u202fmW\n"));
  // A point without a setting of its own.
  optics.mutable_best()->clear_setting();
  EXPECT_EQ(Made(optics).heading(), "f/2.8, 9.408\u202fms, focus 600\u202fmm");
}

TEST(OpticsReport, DrawsWhatEveryFNumberCanDo) {
  const v1::Report section = SectionOf(Made(SampleOptics()), "f-number");
  const auto charts = ChartsOf(section);
  ASSERT_EQ(charts.size(), 4u);
  for (const v1::ReportChart& chart : charts) {
    // f/2.8 and f/4 are as good as the best.
    EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_MODEL, Mark::DOTS), 2);
    EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_MODEL, Mark::HOLLOW_DOTS), 7);
    EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_REFERENCE, Mark::RINGS), 1);
    EXPECT_EQ(chart.x().ticks_size(), 9);
    EXPECT_EQ(chart.x().ticks(3), 4);
    EXPECT_TRUE(chart.x().logarithmic());
  }
  // The real camera's u_px, the constant exposure, and the longest exposure time.
  EXPECT_EQ(PointsOf(charts[2], v1::REPORT_COLOUR_BLUE, Mark::DOTS), 2);
  EXPECT_EQ(PointsOf(charts[2], v1::REPORT_COLOUR_BLUE, Mark::HOLLOW_DOTS), 7);
  EXPECT_EQ(PointsOf(charts[1], v1::REPORT_COLOUR_BLUE, Mark::DASHED_LINE), 9);
  ASSERT_EQ(charts[1].lines_size(), 1);
  EXPECT_EQ(charts[1].y().unit(), "ms");
  EXPECT_DOUBLE_EQ(charts[1].lines(0).at(), 50);
  EXPECT_THAT(TextOf(section), HasSubstr("Longest exposure time possible, 50\u202fms: half a pixel "
                                         "of motion blur at the stage's speed."));
}

TEST(OpticsReport, DrawsNoRealCameraWithoutACorrection) {
  v1::OpticsPlan optics = SampleOptics();
  optics.clear_correction();
  optics.mutable_best()->clear_expected_real_u_px();
  for (v1::OpticsPoint& point : *optics.mutable_curve()) {
    point.clear_expected_real_u_px();
    point.clear_expected_real_u_px_interval();
    point.clear_constant_exposure_time_s();
  }
  const v1::Report report = Made(optics);
  for (const v1::ReportChart& chart : ChartsOf(SectionOf(report, "f-number"))) {
    EXPECT_EQ(SeriesIn(chart, v1::REPORT_COLOUR_BLUE), 0);
  }
  EXPECT_THAT(TextOf(report), Not(HasSubstr("real camera")));
  EXPECT_THAT(TextOf(report), HasSubstr("No verification was given"));
  EXPECT_THAT(TextOf(SectionOf(report, "curve")), Not(HasSubstr(", real")));
}

// A band's ends are where its interval ends, not symmetric about the value.
TEST(OpticsReport, BandsReachFromLowerToUpper) {
  v1::OpticsPlan optics;
  for (const double f_number : {2.0, 4.0}) {
    v1::OpticsPoint* point = optics.add_curve();
    point->set_f_number(f_number);
    point->set_cost(1);
    point->mutable_cost_interval()->set_lower(0.75);
    point->mutable_cost_interval()->set_upper(2);
  }
  const v1::ReportBlock group = FNumberBlocks(CurveOf(optics)).back();
  const v1::ReportSeries& line = group.group().blocks(0).chart().series(0);
  ASSERT_EQ(line.low_size(), 2);
  EXPECT_EQ(line.low(0), 0.75);
  EXPECT_EQ(line.high(0), 2);
  EXPECT_EQ(line.y(0), 1);
}

TEST(OpticsReport, DrawsCostAgainstExposureTime) {
  const v1::Report section = SectionOf(Made(SampleOptics()), "exposure");
  ASSERT_EQ(ChartsOf(section).size(), 1u);
  const v1::ReportChart chart = ChartsOf(section)[0];
  int lines = 0, dots = 0;
  std::vector<std::string> names;
  for (const v1::ReportSeries& series : chart.series()) {
    if (series.colour() != v1::REPORT_COLOUR_IN_ORDER) continue;
    if (series.mark() == Mark::DOTS) {
      ++dots;
      continue;
    }
    ++lines;
    names.push_back(series.name());
    ASSERT_EQ(series.x_size(), 24);
    // The exposures were not asked for in order, but are drawn in it.
    for (int i = 1; i < series.x_size(); ++i) EXPECT_GT(series.x(i), series.x(i - 1));
  }
  EXPECT_EQ(lines, 9);
  EXPECT_EQ(dots, 9);
  EXPECT_THAT(names, ::testing::Contains("f/5.6"));
  EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_REFERENCE, Mark::RINGS), 1);
  EXPECT_THAT(TextOf(section), Not(HasSubstr("f-numbers are drawn")));
}

TEST(OpticsReport, DrawsAtMostTwelveLinesTheBestAmongThem) {
  v1::OpticsPlan optics = SampleOptics();
  const v1::OpticsPoint some = optics.curve(0);
  optics.clear_curve();
  for (int i = 0; i < 40; ++i) {
    v1::OpticsPoint* point = optics.add_curve();
    *point = some;
    point->set_f_number(1.4 + 0.25 * i);
  }
  for (const int best : {0, 1, 17, 38, 39}) {
    *optics.mutable_best() = optics.curve(best);
    const v1::Report section = SectionOf(Made(optics), "exposure");
    EXPECT_EQ(PointsOf(ChartsOf(section)[0], v1::REPORT_COLOUR_IN_ORDER, Mark::DOTS), 12);
    EXPECT_THAT(TextOf(section), HasSubstr("12 of 40 f-numbers are drawn."));
    EXPECT_THAT(TextOf(section),
                HasSubstr("\n" + FNumberText(optics.curve(best).f_number()) + "\n"));
  }
}

TEST(OpticsReport, ListsTheCurve) {
  const v1::ReportTable table = FirstTableOf(Made(SampleOptics()), "curve");
  ASSERT_EQ(table.rows_size(), 9);
  const auto cell = [&](const char* column) { return CellOf(table, "f/5.6", column); };
  EXPECT_EQ(cell("exposure time").text(), "37.632\u202fms");
  EXPECT_EQ(cell("exposure time").number(), SampleOptics().curve(4).exposure_time_s());
  EXPECT_EQ(cell("exposure time").unit(), "s");
  EXPECT_EQ(cell("focus").text(), "600\u202fmm");
  EXPECT_EQ(cell("focus").detail(), "590.0\u202f\u2026\u202f620.0\u202fmm");
  EXPECT_EQ(cell("u\u209a\u2093").text(), "0.207\u202fpx");
  EXPECT_EQ(cell("u\u209a\u2093").detail(), "0.187\u202f\u2026\u202f0.249\u202fpx");
  EXPECT_EQ(cell("u\u209a\u2093, real").text(), "0.244\u202fpx");
  EXPECT_EQ(cell("detected").text(), "91.6\u202f%");
  EXPECT_EQ(cell("detected").detail(), "88.6\u202f\u2026\u202f92.6\u202f%");
  EXPECT_EQ(cell("bias").text(), "\u22120.021\u202fpx");
  EXPECT_EQ(cell("false lines per column").text(), "0.0034");
  EXPECT_EQ(cell("clipped").text(), "4.8\u202f%");
  EXPECT_EQ(cell("height").text(), "20.7\u202f\u00b5m");
  EXPECT_EQ(cell("cost").text(), "0.441\u202fpx");
  EXPECT_EQ(cell("cost").detail(), "0.397\u202f\u2026\u202f0.530\u202fpx");
  std::vector<std::string> good;
  for (const v1::ReportRow& row : table.rows()) {
    good.push_back(row.cells(row.cells_size() - 1).text());
  }
  EXPECT_EQ(std::count(good.begin(), good.end(), "best"), 1);
  EXPECT_EQ(std::count(good.begin(), good.end(), "yes"), 1);
  EXPECT_EQ(std::count(good.begin(), good.end(), "no"), 7);
}

TEST(OpticsReport, SortsTheCurveByFNumber) {
  v1::OpticsPlan optics = SampleOptics();
  const std::string json = ToJson(Made(optics));
  optics.mutable_curve()->SwapElements(0, 7);
  EXPECT_EQ(ToJson(Made(optics)), json);
}

TEST(OpticsReport, SaysWhatAFreedomIsWorth) {
  v1::OpticsPlan optics = SampleOptics();
  const v1::ReportTable table = FirstTableOf(Made(optics), "alternatives");
  ASSERT_EQ(table.rows_size(), 2);
  const auto cell = [&](const char* column) {
    return CellOf(table, "without a tilted sensor", column).text();
  };
  EXPECT_THAT(cell("best setting"), HasSubstr("f/5.6, 37.632\u202fms"));
  EXPECT_EQ(cell("cost"), "0.502\u202fpx");
  EXPECT_EQ(cell("more than the best"), "0.113\u202fpx");
  EXPECT_EQ(cell("as good as the best"), "no");
  EXPECT_EQ(CellOf(table, "with one exposure", "as good as the best").text(), "yes");
  EXPECT_EQ(CellOf(table, "without a tilted sensor", "for").text(), "");
  *optics.mutable_scans(1)->add_alternatives() = optics.common().alternatives(0);
  const v1::ReportTable named = FirstTableOf(Made(optics), "alternatives");
  EXPECT_EQ(CellOf(named, "without a tilted sensor", "for").text(), "all scans");
  EXPECT_EQ(named.rows(2).cells(1).text(), "scan 2");
}

TEST(OpticsReport, ListsScansBesideTheirCommonSetting) {
  const v1::ReportTable table = FirstTableOf(Made(SampleOptics()), "scans");
  ASSERT_EQ(table.rows_size(), 3);
  const auto cell = [&](const char* row, const char* column) {
    return CellOf(table, row, column).text();
  };
  EXPECT_EQ(cell("all scans", "u\u209a\u2093"), "0.189\u202fpx");
  EXPECT_EQ(cell("all scans", "time"), "41.5\u202fs");
  EXPECT_EQ(cell("all scans", "frames"), "3");
  EXPECT_EQ(cell("all scans", "represented"), "91.4\u202f%");
  EXPECT_EQ(cell("scan 1", "frames"), "2");
  std::string texts;
  for (const v1::ReportRow& row : table.rows()) {
    for (const v1::ReportCell& c : row.cells()) texts += c.text() + "\n" + c.detail() + "\n";
  }
  for (const char* text :
       {"f/4, 19.2\u202fms, focus 600\u202fmm", "f/4 cannot be told apart from it.", "92.5\u202f%",
        "39.2\u202fs", "40.2\u202fs", "88.3\u202f%", "no limit", "20\u202fms",
        "half a pixel of motion blur"}) {
    EXPECT_THAT(texts, HasSubstr(text));
  }
  v1::OpticsPlan optics = SampleOptics();
  optics.mutable_scans(0)->clear_best();
  EXPECT_EQ(CellOf(FirstTableOf(Made(optics), "scans"), "scan 1", "setting").text(),
            "none was found");
}

TEST(OpticsReport, ShowsTheFrames) {
  v1::OpticsPlan optics = SampleOptics();
  v1::Report frames = SectionOf(Made(optics), "frames");
  ASSERT_EQ(PicturesOf(frames).size(), 7u);
  for (const v1::ReportPicture& picture : PicturesOf(frames)) {
    EXPECT_EQ(picture.png(), "picture bytes");
  }
  for (const char* text :
       {"Scan 1, frame 12", "30\u202fmm", "45.0\u202f%", "1\u202f234", "0.187\u202fpx",
        "95.3\u202f%", "They represent 91.4\u202f%", "With one setting for all scans",
        "Scan 2 with its own setting, f/4, 19.2\u202fms"}) {
    EXPECT_THAT(TextOf(frames), HasSubstr(text));
  }
  optics.clear_scans();
  optics.mutable_common()->mutable_frames(0)->clear_picture_png();
  frames = SectionOf(Made(optics), "frames");
  EXPECT_EQ(PicturesOf(frames).size(), 2u);
  EXPECT_EQ(TablesOf(frames).size(), 3u);
  EXPECT_THAT(TextOf(frames), Not(HasSubstr("With one setting for all scans")));
}

TEST(OpticsReport, ListsDevicesTheChosenFirst) {
  v1::DeviceChoice devices = SampleDevices();
  const v1::ReportTable table = FirstTableOf(Made(SampleOptics(), &devices), "devices");
  ASSERT_EQ(table.rows_size(), 3);
  EXPECT_EQ(table.rows(0).cells(1).text(), "chosen");
  EXPECT_THAT(table.rows(1).cells(1).text(),
              HasSubstr("its pixels are too coarse for the finest tolerance"));
  EXPECT_THAT(table.rows(2).cells(1).text(), HasSubstr("it costs 0.080 px more"));
  EXPECT_EQ(CellOf(table, "Camera B", "camera, lens, laser").detail(),
            "25 mm, Line projector 660 nm");
  const auto cell = [&](const char* column) { return CellOf(table, "Camera A", column).text(); };
  EXPECT_EQ(cell("field of view"), "160\u202f\u00d7\u202f120\u202fmm");
  EXPECT_EQ(cell("price"), "1\u202f845\u202f\u20ac");
  std::string texts;
  int unknown = 0;
  for (const v1::ReportRow& row : table.rows()) {
    for (const v1::ReportCell& c : row.cells()) {
      texts += c.text() + "\n";
      unknown += c.text() == "\u2013" ? 1 : 0;
    }
  }
  for (const char* text : {"78.1\u202f\u00b5m", "12.3\u202fmm", "9.4\u202fms", "17.7\u202f\u00b5m",
                           "93.1\u202f%", "0.373\u202fpx"}) {
    EXPECT_THAT(texts, HasSubstr(text));
  }
  // Combinations that were not rendered have no results.
  EXPECT_EQ(unknown, 6);
  for (int i = 0; i < 250; ++i) *devices.add_combinations() = devices.combinations(0);
  EXPECT_THAT(TextOf(SectionOf(Made(SampleOptics(), &devices), "devices")),
              HasSubstr("53 more combinations are in devices.json."));
}

TEST(OpticsReport, SaysHowItWasComputed) {
  const std::string method = TextOf(SectionOf(Made(SampleOptics()), "method"));
  for (const char* text :
       {"eq. 6.5", "eq. 6.8", "95 of 100 cases", "standard error of the difference",
        "plate/verification.json", "15\u202f%", "6.2\u202f%", "\n16\n", "inspection Cylinder head",
        "Sightline 0.1.0", "seed 7", "23\u202f456 images"}) {
    EXPECT_THAT(method, HasSubstr(text));
  }
}

TEST(OpticsReport, HasNoEmptySections) {
  const v1::Report report = Made(v1::OpticsPlan());
  EXPECT_EQ(report.sections_size(), 1);  // how it was computed
  EXPECT_EQ(TablesOf(report).size() + ChartsOf(report).size(), 0u);
  EXPECT_EQ(report.heading(), "No setting was found");
  const v1::DeviceChoice no_devices;
  EXPECT_EQ(ToJson(Made(v1::OpticsPlan(), &no_devices)), ToJson(report));

  const v1::OpticsPlan full = SampleOptics();
  EXPECT_EQ(Made(full).sections_size(), 7);
  // Every part on its own may be missing, or hold messages without any field.
  const auto* descriptor = v1::OpticsPlan::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    v1::OpticsPlan optics = full;
    optics.GetReflection()->ClearField(&optics, descriptor->field(i));
    Made(optics);
    if (descriptor->field(i)->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) {
      continue;
    }
    if (descriptor->field(i)->is_repeated()) {
      optics.GetReflection()->AddMessage(&optics, descriptor->field(i));
    } else {
      optics.GetReflection()->MutableMessage(&optics, descriptor->field(i));
    }
    Made(optics);
  }
  v1::OpticsPlan bare;
  bare.add_curve()->add_exposures();
  bare.mutable_common()->add_alternatives();
  bare.mutable_common()->add_frames();
  bare.mutable_correction()->add_by_f_number();
  v1::DeviceChoice bare_devices;
  bare_devices.add_combinations();
  Made(bare, &bare_devices);
}

// The best and the curve are taken from the common choice if they stand only there.
TEST(OpticsReport, TakesTheCurveOfTheCommonChoice) {
  const v1::OpticsPlan full = SampleOptics();
  v1::OpticsPlan optics = full;
  *optics.mutable_common()->mutable_best() = full.best();
  *optics.mutable_common()->mutable_curve() = full.curve();
  optics.clear_best();
  optics.clear_curve();
  EXPECT_EQ(ToJson(Made(optics)), ToJson(Made(full)));
}

TEST(OpticsReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::OpticsPlan optics = SampleOptics();
    v1::DeviceChoice devices = SampleDevices();
    SetAllNumbers(&optics, value);
    SetAllNumbers(&devices, value);
    Made(optics, &devices);
  }
}

TEST(OpticsReport, IsWrittenAsPageAndData) {
  const std::string folder = ::testing::TempDir() + "/optics_report_test";
  std::filesystem::create_directories(folder);
  const v1::DeviceChoice devices = SampleDevices();
  ASSERT_TRUE(WriteOpticsReport(SampleOptics(), &devices, folder + "/report.html").ok());
  const auto bytes = [](const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  };
  const v1::Report report = Made(SampleOptics(), &devices);
  EXPECT_EQ(bytes(folder + "/report.html"), ReportPage(report, "report.json"));
  EXPECT_EQ(bytes(folder + "/report.json"), ToJson(report));
  std::filesystem::remove_all(folder);
  EXPECT_FALSE(WriteOpticsReport(SampleOptics(), nullptr, "/no/such/folder/report.html").ok());
}

TEST(OpticsText, SharesAreRoundedButNeverToAllOrNothing) {
  EXPECT_EQ(ShareText(0), "0\u202f%");
  EXPECT_EQ(ShareText(0.0001), "<\u202f0.1\u202f%");
  EXPECT_EQ(ShareText(0.8534), "85.3\u202f%");
  EXPECT_EQ(ShareText(0.99999), ">\u202f99.9\u202f%");
  EXPECT_EQ(ShareText(1), "100\u202f%");
  EXPECT_EQ(ShareText(std::numeric_limits<double>::quiet_NaN()), "\u2013");
}

TEST(OpticsText, NothingDetectedHasNoScatter) {
  v1::OpticsPlan optics = SampleOptics();
  optics.mutable_best()->set_profile_coverage(0);
  optics.mutable_best()->set_u_px(0);
  const v1::ReportFact scatter = FigureOf(Made(optics), "scatter of the line, u\u209a\u2093");
  EXPECT_EQ(scatter.text(), "\u2013");
  EXPECT_FALSE(scatter.has_number());
}

}  // namespace
}  // namespace sightline
