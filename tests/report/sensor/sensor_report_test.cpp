// SPDX-License-Identifier: Apache-2.0
#include "report/sensor/sensor_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "core/json/strict_json.h"
#include "report/document/report_page.h"
#include "tests/report/recordings/sample_sensor.h"
#include "tests/report/report_reading.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

using Mark = v1::ReportSeries;

v1::Report Made(const v1::SensorDiagnosis& diagnosis) {
  auto report = SensorReport(diagnosis);
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  EXPECT_EQ(ReportFault(*report), "");
  return *report;
}

TEST(SensorReport, LeadsWithTheFinding) {
  const v1::Report report = Made(SampleSensorDiagnosis());
  EXPECT_EQ(report.heading(),
            "The camera answers with up to 2 % less than in proportion to the light.");
  EXPECT_EQ(FindingOf(report),
            "2 departures from the linear model of EMVA 1288 were found, of 3 that these images "
            "can show. 1 more would need other recordings.");
  EXPECT_EQ(report.finding(0).text(), "2 departures");
  EXPECT_TRUE(report.finding(0).strong());
  EXPECT_THAT(TextOf(report), HasSubstr("58.5 \u2192 1.00"));
  ASSERT_EQ(report.warnings_size(), 1);
  EXPECT_EQ(report.warnings(0), "Step 17 has two images that differ by more than noise.");
}

TEST(SensorReport, SaysHowLargeADepartureIs) {
  const v1::Report found = SectionOf(Made(SampleSensorDiagnosis()), "departures");
  ASSERT_EQ(TablesOf(found).size(), 1u);
  const v1::ReportTable table = TablesOf(found)[0];
  const v1::ReportCell name = CellOf(table, "Response nonlinearity", "departure");
  EXPECT_EQ(name.detail(), "The signal falls short of proportion by 2 % at the top.");
  const v1::ReportCell size = CellOf(table, "Response nonlinearity", "size");
  EXPECT_THAT(size.text(), HasSubstr("\u22122.010\u202f\u00b1\u202f0.070\u202f%"));
  EXPECT_FALSE(size.has_number());  // there are two of them
  const v1::ReportCell one = CellOf(table, "Row noise", "size");
  EXPECT_EQ(one.number(), 1.34);
  EXPECT_EQ(one.unit(), "e\u207b");
  EXPECT_THAT(TextOf(found), HasSubstr("1.340\u202f\u00b1\u202f0.080\u202fe\u207b"));
  EXPECT_THAT(TextOf(found), HasSubstr("p < 10\u207b\u2076"));
  EXPECT_THAT(TextOf(found), HasSubstr("p = 0.0002"));
  EXPECT_THAT(TextOf(found), HasSubstr("97.3\u202f%"));
  EXPECT_THAT(TextOf(found), Not(HasSubstr("Light drift")));
}

TEST(SensorReport, FoldsAwayWhatWasNotFound) {
  const v1::Report others = SectionOf(Made(SampleSensorDiagnosis()), "others");
  ASSERT_EQ(GroupsOf(others).size(), 2u);
  for (const v1::ReportGroup& group : GroupsOf(others)) EXPECT_TRUE(group.folded());
  EXPECT_EQ(GroupsOf(others)[0].title(), "Looked for and not found: 1");
  EXPECT_EQ(GroupsOf(others)[1].title(), "These images cannot show: 1");
  EXPECT_THAT(TextOf(others), HasSubstr("Light drift"));
  EXPECT_THAT(TextOf(others), HasSubstr("Record dark images at two exposure times or more."));
}

TEST(SensorReport, PlotsEveryStepAgainstBothModels) {
  v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
  int saturated = 0;
  for (const v1::PhotonTransferPoint& point : diagnosis.photon_transfer()) {
    saturated += point.saturated() ? 1 : 0;
  }
  const int used = diagnosis.photon_transfer_size() - saturated;
  ASSERT_GT(saturated, 0);
  auto charts = ChartsOf(SectionOf(Made(diagnosis), "photon-transfer"));
  ASSERT_EQ(charts.size(), 3u);
  EXPECT_EQ(PointsOf(charts[0], v1::REPORT_COLOUR_OBSERVED, Mark::DOTS), used);
  EXPECT_EQ(PointsOf(charts[0], v1::REPORT_COLOUR_OBSERVED, Mark::HOLLOW_DOTS), saturated);
  EXPECT_EQ(PointsOf(charts[0], v1::REPORT_COLOUR_REFERENCE, Mark::DASHED_LINE), used);
  EXPECT_EQ(PointsOf(charts[0], v1::REPORT_COLOUR_MODEL, Mark::LINE), used);
  for (const size_t residual : {1, 2}) {
    const v1::ReportChart& chart = charts[residual];
    EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_REFERENCE, Mark::HOLLOW_DOTS), used);
    EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_MODEL, Mark::DOTS), used);
  }
  EXPECT_EQ(charts[0].y().unit(), "DN\u00b2");
  EXPECT_EQ(charts[1].y().title(), "signal over model \u2212 1");
  EXPECT_EQ(charts[2].y().title(), "residual");
  // Two standard errors about the model that counts: on the points, in the ordinate's unit.
  const v1::ReportSeries& model = charts[1].series(1);
  ASSERT_EQ(model.low_size(), used);
  for (int i = 0; i < used; ++i) {
    EXPECT_NEAR(0.5 * (model.low(i) + model.high(i)), model.y(i), 1e-9);
  }
  EXPECT_THAT(charts[0].series(0).notes(0), HasSubstr("40\u202f\u00b5s, 120.0 photons; mean "));

  // Without a departure both models are one.
  for (v1::SensorDeparture& departure : *diagnosis.mutable_departures()) departure.set_found(false);
  diagnosis.set_finding("");
  const v1::Report report = Made(diagnosis);
  EXPECT_EQ(report.heading(), "These images agree with the linear model of EMVA 1288.");
  EXPECT_EQ(SectionOf(report, "departures").sections_size(), 0);
  charts = ChartsOf(SectionOf(report, "photon-transfer"));
  for (const v1::ReportChart& chart : charts) {
    for (const v1::ReportSeries& series : chart.series()) {
      EXPECT_NE(series.colour(), v1::REPORT_COLOUR_MODEL);
    }
  }
}

TEST(SensorReport, DrawsEveryCurve) {
  const auto curves = ChartsOf(SectionOf(Made(SampleSensorDiagnosis()), "curves"));
  ASSERT_EQ(curves.size(), 2u);
  EXPECT_EQ(curves[0].title(), "Gain of rows");
  EXPECT_EQ(curves[0].x().title(), "row [px]");
  EXPECT_EQ(curves[1].y().title(), "part lost [%]");
  // Dots of few values only; one curve has a band.
  EXPECT_EQ(curves[0].series(0).mark(), Mark::LINE);
  EXPECT_EQ(PointsOf(curves[1], v1::REPORT_COLOUR_MODEL, Mark::LINE_AND_DOTS), 11);
  EXPECT_EQ(curves[0].series(0).low_size() + curves[1].series(0).low_size(), 11);
}

TEST(SensorReport, ComparesQuantitiesWithTheStandard) {
  const v1::Report section = SectionOf(Made(SampleSensorDiagnosis()), "quantities");
  ASSERT_EQ(TablesOf(section).size(), 1u);
  const v1::ReportTable table = TablesOf(section)[0];
  const v1::ReportCell gain = CellOf(table, "Overall system gain", "value");
  EXPECT_EQ(gain.text(), "0.12530\u202fDN/e\u207b");
  EXPECT_NEAR(gain.number(), 0.1253, 1e-9);
  EXPECT_EQ(gain.unit(), "DN/e\u207b");
  EXPECT_EQ(CellOf(table, "Overall system gain", "quantity").detail(), "gain_dn_per_electron");
  const v1::ReportCell prnu = CellOf(table, "Photo response non-uniformity", "value");
  EXPECT_EQ(prnu.text(), "1.210\u202f%");
  EXPECT_NEAR(prnu.number(), 1.21, 1e-9);
  for (const char* text :
       {"0.12490\u202f\u2026\u202f0.12570", "13.33\u202fe\u207b", "EMVA 1288: 6.6",
        "Photons are those of the data file.", "All dark steps have one exposure time."}) {
    EXPECT_THAT(TextOf(section), HasSubstr(text));
  }
  bool has_unknown = false;
  for (const v1::ReportRow& row : table.rows()) {
    has_unknown |= row.cells(1).text() == "\u2013" && !row.cells(1).has_number();
  }
  EXPECT_TRUE(has_unknown);
}

TEST(SensorReport, HasNoEmptySections) {
  EXPECT_EQ(Made(v1::SensorDiagnosis()).sections_size(), 0);
  v1::SensorDiagnosis bare;
  bare.add_quantities();
  bare.add_departures()->set_found(true);
  bare.add_departures();
  bare.add_photon_transfer();
  bare.add_curves();
  Made(bare);
}

TEST(SensorReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
    SetAllNumbers(&diagnosis, value);
    Made(diagnosis);
  }
}

TEST(SensorReport, RefusesListsThatDoNotFitTogether) {
  v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
  diagnosis.mutable_curves(1)->add_standard_errors(1);
  auto report = SensorReport(diagnosis);
  EXPECT_EQ(report.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(report.status().message()),
              HasSubstr("curves[1].standard_errors has size 12, must be 11"));
  diagnosis = SampleSensorDiagnosis();
  diagnosis.mutable_curves(0)->add_abscissa_values(1);
  report = SensorReport(diagnosis);
  EXPECT_THAT(std::string(report.status().message()),
              HasSubstr("curves[0].abscissa_values has size 481, must be 480"));
}

TEST(SensorReport, IsWrittenAsPageAndData) {
  std::string folder = "/tmp/sightline-sensor-report-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const auto bytes = [](const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  };
  ASSERT_TRUE(WriteSensorReport(SampleSensorDiagnosis(), folder + "/report.html").ok());
  const v1::Report report = Made(SampleSensorDiagnosis());
  EXPECT_EQ(bytes(folder + "/report.html"), ReportPage(report, "report.json"));
  EXPECT_EQ(bytes(folder + "/report.json"), ToJson(report));
  EXPECT_FALSE(WriteSensorReport(SampleSensorDiagnosis(), folder + "/none/report.html").ok());
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sightline
