// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/optics/optics_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "planner_client/report/optics/optics_charts.h"
#include "planner_client/report/optics/optics_text.h"
#include "tests/planner_client/report/optics/sample_optics.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string Render(const v1::OpticsPlan& optics, const v1::DeviceChoice* devices = nullptr) {
  const std::string html = RenderOpticsReport(optics, devices);
  EXPECT_EQ(MarkupFault(html), "");
  return html;
}

OpticsCurve CurveOf(const v1::OpticsPlan& optics) {
  OpticsCurve curve;
  for (const v1::OpticsPoint& point : optics.curve()) curve.points.push_back(&point);
  curve.best = &optics.best();
  curve.longest_exposure_time_s = optics.common().longest_exposure_time_s();
  return curve;
}

TEST(OpticsReport, LeadsWithTheSetting) {
  const std::string html = Render(SampleOptics());
  EXPECT_THAT(html, HasSubstr("<h1>f/2.8, 9.408\u202fms, focus 600\u202fmm, laser 5\u202fmW</h1>"));
  EXPECT_THAT(html, HasSubstr("<p class=\"finding\">f/2.8 and f/4 cannot be told apart"));
  EXPECT_THAT(html, HasSubstr("<dd>0.189\u202fpx <small>0.170\u202f\u2026\u202f0.227\u202fpx"));
  EXPECT_THAT(html, HasSubstr("<dd>0.223\u202fpx <small>0.189\u202f\u2026\u202f0.284\u202fpx"));
  EXPECT_THAT(html, HasSubstr("<dd>92.9\u202f% <small>89.9\u202f\u2026\u202f93.9\u202f%"));
  EXPECT_THAT(html, HasSubstr("<dt>cost</dt><dd>0.389\u202fpx <small>0.350\u202f\u2026\u202f"));
  EXPECT_THAT(html, HasSubstr("<dt>false lines per column</dt><dd>0.0034</dd>"));
  EXPECT_THAT(html, HasSubstr("<dt>time of all scans</dt><dd>41.5\u202fs</dd>"));
  EXPECT_THAT(html, HasSubstr("<li>The lens has no catalogued transmission"));
}

TEST(OpticsReport, NamesWhatElseIsSet) {
  v1::OpticsPlan optics = SampleOptics();
  v1::OpticalSetting* setting = optics.mutable_best()->mutable_setting();
  setting->set_second_exposure_time_s(0.0005);
  setting->set_sensor_tilt_x_deg(2.1);
  EXPECT_THAT(Render(optics), HasSubstr("<h1>f/2.8, 9.408\u202fms and 0.5\u202fms, focus "
                                        "600\u202fmm, laser 5\u202fmW, sensor tilted by "
                                        "2.1\u00b0 about its rows</h1>"));
  // In the table only what some f-number has of its own.
  EXPECT_THAT(SectionOf(Render(optics), "curve"), Not(HasSubstr("further")));
  *optics.mutable_curve(2)->mutable_setting() = optics.best().setting();
  optics.mutable_curve(4)->mutable_setting()->set_laser_power_w(0.001);
  const std::string table = SectionOf(Render(optics), "curve");
  EXPECT_THAT(table, HasSubstr("second exposure 0.5\u202fms, laser 5\u202fmW, sensor tilted by "
                               "2.1\u00b0 about its rows</td>"));
  EXPECT_THAT(table, HasSubstr(">laser 1\u202fmW</td>"));
  // A point without a setting of its own.
  optics.mutable_best()->clear_setting();
  EXPECT_THAT(Render(optics), HasSubstr("<h1>f/2.8, 9.408\u202fms, focus 600\u202fmm</h1>"));
}

TEST(OpticsReport, DrawsWhatEveryFNumberCanDo) {
  const std::string charts = SectionOf(Render(SampleOptics()), "f-number");
  EXPECT_EQ(CountOf(charts, "class=\"title\""), 4u);
  // f/2.8 and f/4 are as good as the best; the key has one more of each.
  EXPECT_EQ(CountOf(charts, "class=\"dot model\""), 4u * 2 + 1);
  EXPECT_EQ(CountOf(charts, "class=\"hollow model\""), 4u * 7 + 1);
  EXPECT_EQ(CountOf(charts, "class=\"ring null\""), 4u + 1);
  EXPECT_EQ(CountOf(charts, "class=\"band model\""), 4u + 1);
  // The real camera's u_px, and the constant exposure.
  EXPECT_EQ(CountOf(charts, "class=\"dot blue\""), 2u);
  EXPECT_EQ(CountOf(charts, "class=\"hollow blue\""), 7u);
  EXPECT_EQ(CountOf(charts, "class=\"band blue\""), 1u);
  EXPECT_EQ(CountOf(charts, "class=\"line dashed blue\""), 1u + 1);
  EXPECT_EQ(CountOf(charts, "class=\"mark\""), 1u);  // the longest exposure time
  for (const char* f_number : {"1.4", "2", "2.8", "4", "5.6", "8", "11", "16", "22"}) {
    EXPECT_EQ(CountOf(charts, "text-anchor=\"middle\">" + std::string(f_number) + "</text>"), 4u)
        << f_number;
  }
  EXPECT_THAT(charts,
              HasSubstr("Longest exposure time possible, 50\u202fms: half a pixel of motion "
                        "blur at the stage&#39;s speed."));
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
  const std::string html = Render(optics);
  EXPECT_EQ(CountOf(SectionOf(html, "f-number"), " blue\""), 0u);
  EXPECT_THAT(html, Not(HasSubstr("real camera")));
  EXPECT_THAT(html, HasSubstr("No verification was given"));
  EXPECT_THAT(SectionOf(html, "curve"), Not(HasSubstr(", real")));
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
  const std::string svg = FNumberCharts(CurveOf(optics));
  const std::regex band(
      "class=\"band model\" d=\"M([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)L");
  const std::regex circle("class=\"hollow model\" cx=\"([0-9.]+)\" cy=\"([0-9.]+)\"");
  std::smatch ends, dot;
  ASSERT_TRUE(std::regex_search(svg, ends, band));
  const std::string drawing = svg.substr(svg.find("<div class=\"cards\">"));
  ASSERT_TRUE(std::regex_search(drawing, dot, circle));
  EXPECT_EQ(ends[1], dot[1]);
  const double above = std::stod(dot[2]) - std::stod(ends[2]);
  const double below = std::stod(ends[6]) - std::stod(dot[2]);
  EXPECT_NEAR(above / below, 4, 0.05);
}

// Every dot, ring and corner of a line lies within its drawing.
TEST(OpticsReport, PointsLieInsideTheDrawing) {
  v1::OpticsPlan optics = SampleOptics();
  optics.mutable_curve(8)->set_u_px(40);
  optics.mutable_curve(8)->mutable_u_px_interval()->set_upper(90);
  optics.mutable_curve(0)->set_profile_coverage(1);
  optics.mutable_curve(1)->set_profile_coverage(0);
  const std::string html = Render(optics);
  const std::regex box("<svg class=\"chart[^\"]*\" viewBox=\"0 0 ([0-9]+) ([0-9]+)\" role");
  const std::regex circle("cx=\"([-0-9.]+)\" cy=\"([-0-9.]+)\" r=\"([0-9.]+)\"");
  const std::regex corner("[ML](-?[0-9.]+) (-?[0-9.]+)");
  size_t charts = 0, points = 0;
  for (auto it = std::sregex_iterator(html.begin(), html.end(), box); it != std::sregex_iterator();
       ++it, ++charts) {
    const auto begin = static_cast<size_t>(it->position());
    const std::string svg = html.substr(begin, html.find("</svg>", begin) - begin);
    const double width = std::stod((*it)[1]), height = std::stod((*it)[2]);
    for (const std::regex& pattern : {circle, corner}) {
      for (auto point = std::sregex_iterator(svg.begin(), svg.end(), pattern);
           point != std::sregex_iterator(); ++point, ++points) {
        const double x = std::stod((*point)[1]), y = std::stod((*point)[2]);
        const double radius = point->size() > 3 ? std::stod((*point)[3]) : 0;
        EXPECT_GE(x - radius, 0);
        EXPECT_LE(x + radius, width);
        EXPECT_GE(y - radius, 0);
        EXPECT_LE(y + radius, height);
      }
    }
  }
  EXPECT_EQ(charts, 5u);
  EXPECT_GT(points, 5u * 9);
}

TEST(OpticsReport, DrawsCostAgainstExposureTime) {
  const v1::OpticsPlan optics = SampleOptics();
  const std::string chart = SectionOf(Render(optics), "exposure");
  const std::regex line("<path class=\"line (dashed )?hue[0-9]+\" d=\"(M[^\"]*L[^\"]*)\"");
  size_t lines = 0;
  for (auto it = std::sregex_iterator(chart.begin(), chart.end(), line);
       it != std::sregex_iterator(); ++it) {
    const std::string path = (*it)[2];
    if (path == "M1 6H23") continue;  // the key's
    ++lines;
    EXPECT_EQ(CountOf(path, "L"), 23u);
    // The exposures were not asked for in order, but are drawn in it.
    const std::regex corner("[ML]([0-9.]+) ");
    double last = 0;
    for (auto at = std::sregex_iterator(path.begin(), path.end(), corner);
         at != std::sregex_iterator(); ++at) {
      EXPECT_GT(std::stod((*at)[1]), last);
      last = std::stod((*at)[1]);
    }
  }
  EXPECT_EQ(lines, 9u);
  EXPECT_EQ(CountOf(chart, "class=\"dot hue"), 9u);
  EXPECT_EQ(CountOf(chart, "class=\"ring null\""), 2u);
  EXPECT_THAT(chart, Not(HasSubstr("f-numbers are drawn")));
  EXPECT_THAT(chart, HasSubstr("</svg> f/5.6</span>"));
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
    const std::string chart = SectionOf(Render(optics), "exposure");
    EXPECT_EQ(CountOf(chart, "class=\"dot hue"), 12u);
    EXPECT_THAT(chart, HasSubstr("12 of 40 f-numbers are drawn."));
    EXPECT_THAT(chart,
                HasSubstr("</svg> " + FNumberText(optics.curve(best).f_number()) + "</span>"));
  }
}

TEST(OpticsReport, ListsTheCurve) {
  const std::string table = SectionOf(Render(SampleOptics()), "curve");
  EXPECT_EQ(CountOf(table, "<tr>"), 1u + 9);
  for (const char* text :
       {">f/5.6<", ">37.632\u202fms<", "600\u202fmm<", "590.0\u202f\u2026\u202f620.0\u202fmm",
        "0.207\u202fpx", "0.187\u202f\u2026\u202f0.249\u202fpx", "0.244\u202fpx", "91.6\u202f%",
        "88.6\u202f\u2026\u202f92.6\u202f%", "\u22120.021\u202fpx", ">0.0034<", "4.8\u202f%",
        "20.7\u202f\u00b5m", "0.441\u202fpx", "0.397\u202f\u2026\u202f0.530\u202fpx",
        "<td><strong>best</strong></td>"}) {
    EXPECT_THAT(table, HasSubstr(text));
  }
  EXPECT_EQ(CountOf(table, "<td>yes</td>"), 1u);
  EXPECT_EQ(CountOf(table, "<td>no</td>"), 7u);
}

TEST(OpticsReport, SortsTheCurveByFNumber) {
  v1::OpticsPlan optics = SampleOptics();
  const std::string html = Render(optics);
  optics.mutable_curve()->SwapElements(0, 7);
  EXPECT_EQ(Render(optics), html);
}

TEST(OpticsReport, SaysWhatAFreedomIsWorth) {
  v1::OpticsPlan optics = SampleOptics();
  std::string table = SectionOf(Render(optics), "alternatives");
  EXPECT_EQ(CountOf(table, "<tr>"), 1u + 2);
  for (const char* text : {"without a tilted sensor", "f/5.6, 37.632\u202fms", "0.502\u202fpx",
                           "0.113\u202fpx", "with one exposure", ">no<", ">yes<"}) {
    EXPECT_THAT(table, HasSubstr(text));
  }
  EXPECT_THAT(table, Not(HasSubstr("scan")));
  *optics.mutable_scans(1)->add_alternatives() = optics.common().alternatives(0);
  table = SectionOf(Render(optics), "alternatives");
  EXPECT_THAT(table, HasSubstr("<td class=\"words\">all scans</td>"));
  EXPECT_THAT(table, HasSubstr("<td class=\"words\">scan 2</td>"));
}

TEST(OpticsReport, ListsScansBesideTheirCommonSetting) {
  const std::string table = SectionOf(Render(SampleOptics()), "scans");
  EXPECT_EQ(CountOf(table, "<tr>"), 1u + 3);
  for (const char* text :
       {"all scans", ">scan 1<", ">scan 2<", "f/4, 19.2\u202fms, focus 600\u202fmm",
        "f/4 cannot be told apart from it.", "0.189\u202fpx", "92.5\u202f%", "41.5\u202fs",
        "39.2\u202fs", "40.2\u202fs", "<td>3</td>", "<td>2</td>", "91.4\u202f%", "88.3\u202f%",
        ">no limit<", "20\u202fms", "half a pixel of motion blur<"}) {
    EXPECT_THAT(table, HasSubstr(text));
  }
  v1::OpticsPlan optics = SampleOptics();
  optics.mutable_scans(0)->clear_best();
  EXPECT_THAT(SectionOf(Render(optics), "scans"), HasSubstr("none was found"));
}

TEST(OpticsReport, ShowsTheFrames) {
  v1::OpticsPlan optics = SampleOptics();
  std::string frames = SectionOf(Render(optics), "frames");
  EXPECT_EQ(CountOf(frames, "<img"), 7u);
  EXPECT_EQ(CountOf(frames, "data:image/png;base64," + absl::Base64Escape("picture bytes")), 7u);
  for (const char* text :
       {"Scan 1, frame 12", "30\u202fmm", "45.0\u202f%", "1\u202f234", "0.187\u202fpx",
        "95.3\u202f%", "They represent 91.4\u202f%", "With one setting for all scans",
        "Scan 2 with its own setting, f/4, 19.2\u202fms"}) {
    EXPECT_THAT(frames, HasSubstr(text));
  }
  optics.clear_scans();
  optics.mutable_common()->mutable_frames(0)->clear_picture_png();
  frames = SectionOf(Render(optics), "frames");
  EXPECT_EQ(CountOf(frames, "<img"), 2u);
  EXPECT_EQ(CountOf(frames, "class=\"card\""), 3u);
  EXPECT_THAT(frames, Not(HasSubstr("With one setting for all scans")));
}

TEST(OpticsReport, ListsDevicesTheChosenFirst) {
  v1::DeviceChoice devices = SampleDevices();
  const std::string table = SectionOf(Render(SampleOptics(), &devices), "devices");
  EXPECT_EQ(CountOf(table, "<tr>"), 1u + 3);
  const size_t chosen = table.find("<strong>chosen</strong>");
  const size_t too_coarse = table.find("its pixels are too coarse for the finest tolerance");
  const size_t dearer = table.find("it costs 0.080 px more");
  EXPECT_LT(chosen, too_coarse);
  EXPECT_LT(too_coarse, dearer);
  EXPECT_NE(dearer, std::string::npos);
  for (const char* text :
       {">Camera B<", ">25 mm<br>Line projector 660 nm<", "160\u202f\u00d7\u202f120\u202fmm",
        "78.1\u202f\u00b5m", "12.3\u202fmm", "9.4\u202fms", "17.7\u202f\u00b5m", "93.1\u202f%",
        "0.373\u202fpx", "1\u202f845\u202f\u20ac"}) {
    EXPECT_THAT(table, HasSubstr(text));
  }
  // What was not rendered has no results.
  EXPECT_EQ(CountOf(table, "<td>\u2013</td>"), 6u);
  for (int i = 0; i < 250; ++i) *devices.add_combinations() = devices.combinations(0);
  EXPECT_THAT(SectionOf(Render(SampleOptics(), &devices), "devices"),
              HasSubstr("53 more combinations are in devices.json."));
}

TEST(OpticsReport, SaysHowItWasComputed) {
  const std::string method = SectionOf(Render(SampleOptics()), "method");
  for (const char* text :
       {"eq. 6.5", "eq. 6.8", "95 of 100 cases", "standard error of the difference",
        "plate/verification.json", "15\u202f%", "6.2\u202f%", ">16<", "inspection Cylinder head",
        "Sightline 0.1.0", "seed 7", "23\u202f456 images"}) {
    EXPECT_THAT(method, HasSubstr(text));
  }
}

TEST(OpticsReport, HasNoEmptySections) {
  const std::string html = Render(v1::OpticsPlan());
  EXPECT_EQ(CountOf(html, "<section"), 1u);  // how it was computed
  EXPECT_EQ(CountOf(html, "<table"), 0u);
  EXPECT_EQ(CountOf(html, "<svg"), 0u);
  EXPECT_THAT(html, HasSubstr("<h1>No setting was found</h1>"));
  const v1::DeviceChoice no_devices;
  EXPECT_EQ(Render(v1::OpticsPlan(), &no_devices), html);

  const v1::OpticsPlan full = SampleOptics();
  EXPECT_EQ(CountOf(Render(full), "<section"), 7u);
  // Every part on its own may be missing, or hold messages without any field.
  const auto* descriptor = v1::OpticsPlan::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    v1::OpticsPlan optics = full;
    optics.GetReflection()->ClearField(&optics, descriptor->field(i));
    Render(optics);
    if (descriptor->field(i)->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) {
      continue;
    }
    if (descriptor->field(i)->is_repeated()) {
      optics.GetReflection()->AddMessage(&optics, descriptor->field(i));
    } else {
      optics.GetReflection()->MutableMessage(&optics, descriptor->field(i));
    }
    Render(optics);
  }
  v1::OpticsPlan bare;
  bare.add_curve()->add_exposures();
  bare.mutable_common()->add_alternatives();
  bare.mutable_common()->add_frames();
  bare.mutable_correction()->add_by_f_number();
  v1::DeviceChoice bare_devices;
  bare_devices.add_combinations();
  Render(bare, &bare_devices);
}

// The best and the curve are taken from the common choice if they stand only there.
TEST(OpticsReport, TakesTheCurveOfTheCommonChoice) {
  const v1::OpticsPlan full = SampleOptics();
  v1::OpticsPlan optics = full;
  *optics.mutable_common()->mutable_best() = full.best();
  *optics.mutable_common()->mutable_curve() = full.curve();
  optics.clear_best();
  optics.clear_curve();
  EXPECT_EQ(Render(optics), Render(full));
}

TEST(OpticsReport, EscapesEveryText) {
  v1::OpticsPlan optics = SampleOptics();
  v1::DeviceChoice devices = SampleDevices();
  for (const char* hostile : {"<script>alert('x')</script>&\"_^", "\"><img src=\"x\">"}) {
    SetAllTexts(&optics, hostile);
    SetAllTexts(&devices, hostile);
    const std::string html = Render(optics, &devices);
    EXPECT_THAT(html, Not(HasSubstr("<script")));
    EXPECT_THAT(html, Not(HasSubstr("<img src=\"x\"")));
  }
}

TEST(OpticsReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::OpticsPlan optics = SampleOptics();
    v1::DeviceChoice devices = SampleDevices();
    SetAllNumbers(&optics, value);
    SetAllNumbers(&devices, value);
    Render(optics, &devices);
  }
}

TEST(OpticsReport, LoadsNothingAndRunsNothing) {
  const v1::DeviceChoice devices = SampleDevices();
  const std::string html = Render(SampleOptics(), &devices);
  EXPECT_EQ(OutsideReference(html), "");
}

TEST(OpticsReport, IsWrittenAsItIsRendered) {
  const std::string path = ::testing::TempDir() + "/optics_report_test.html";
  const v1::DeviceChoice devices = SampleDevices();
  ASSERT_TRUE(WriteOpticsReport(SampleOptics(), &devices, path).ok());
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  EXPECT_EQ(text.str(), Render(SampleOptics(), &devices));
  std::filesystem::remove(path);
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
  EXPECT_THAT(Render(optics), HasSubstr("<dd>\u2013</dd>"));
}

}  // namespace
}  // namespace sightline
