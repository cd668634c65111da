// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/recordings/sensor_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/planner_client/report/recordings/sample_sensor.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string Render(const v1::SensorDiagnosis& diagnosis) {
  const auto html = RenderSensorReport(diagnosis);
  EXPECT_TRUE(html.ok()) << html.status();
  EXPECT_EQ(MarkupFault(html.value_or("")), "");
  return html.value_or("");
}

TEST(SensorReport, LeadsWithTheFinding) {
  const std::string html = Render(SampleSensorDiagnosis());
  EXPECT_THAT(html, HasSubstr("<h1>The camera answers with up to 2 % less than in proportion to "
                              "the light.</h1>"));
  EXPECT_THAT(html, HasSubstr("<strong>2 departures</strong> from the linear model of EMVA 1288 "
                              "were found, of 3 that these images can show. 1 more would need "
                              "other recordings."));
  EXPECT_THAT(html, HasSubstr("58.5 \u2192 1.00"));
  EXPECT_THAT(html, HasSubstr("Step 17 has two images that differ by more than noise."));
}

TEST(SensorReport, SaysHowLargeADepartureIs) {
  const std::string found = SectionOf(Render(SampleSensorDiagnosis()), "departures");
  EXPECT_THAT(found, HasSubstr("Response nonlinearity"));
  EXPECT_THAT(found, HasSubstr("The signal falls short of proportion by 2 % at the top."));
  EXPECT_THAT(found, HasSubstr("<strong>\u22122.010\u202f\u00b1\u202f0.070\u202f%</strong>"));
  EXPECT_THAT(found, HasSubstr("<strong>1.340\u202f\u00b1\u202f0.080\u202fe\u207b</strong>"));
  EXPECT_THAT(found, HasSubstr("p &lt; 10\u207b\u2076"));
  EXPECT_THAT(found, HasSubstr("p = 0.0002"));
  EXPECT_THAT(found, Not(HasSubstr("Light drift")));
}

TEST(SensorReport, FoldsAwayWhatWasNotFound) {
  const std::string others = SectionOf(Render(SampleSensorDiagnosis()), "others");
  EXPECT_EQ(CountOf(others, "<details>"), 2u);
  EXPECT_THAT(others, HasSubstr("Looked for and not found: 1"));
  EXPECT_THAT(others, HasSubstr("Light drift"));
  EXPECT_THAT(others, HasSubstr("These images cannot show: 1"));
  EXPECT_THAT(others, HasSubstr("Record dark images at two exposure times or more."));
}

TEST(SensorReport, PlotsEveryStepAgainstBothModels) {
  v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
  size_t saturated = 0;
  for (const v1::PhotonTransferPoint& point : diagnosis.photon_transfer()) {
    saturated += point.saturated();
  }
  const size_t used = diagnosis.photon_transfer_size() - saturated;
  ASSERT_GT(saturated, 0u);
  std::string charts = SectionOf(Render(diagnosis), "photon-transfer");
  // The key has one more of each.
  EXPECT_EQ(CountOf(charts, "class=\"dot observed\""), used + 1);
  EXPECT_EQ(CountOf(charts, "class=\"hollow observed\""), saturated + 1);
  EXPECT_EQ(CountOf(charts, "class=\"line dashed null\""), 1u + 1);
  EXPECT_EQ(CountOf(charts, "class=\"line model\""), 1u + 1);
  EXPECT_EQ(CountOf(charts, "class=\"hollow null\""), 2 * used + 1);
  EXPECT_EQ(CountOf(charts, "class=\"dot model\""), 2 * used + 1);
  for (const char* axis : {"variance in time [DN\u00b2]", "signal over model \u2212 1 [%]",
                           "residual [standard errors]", "mean signal [DN]"}) {
    EXPECT_THAT(charts, HasSubstr(axis));
  }
  EXPECT_THAT(charts, HasSubstr("40\u202f\u00b5s, 120.0 photons; mean "));

  // Without a departure both models are one.
  for (v1::SensorDeparture& departure : *diagnosis.mutable_departures()) departure.set_found(false);
  diagnosis.set_finding("");
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, HasSubstr("<h1>These images agree with the linear model of EMVA 1288.</h1>"));
  EXPECT_EQ(SectionOf(html, "departures"), "");
  charts = SectionOf(html, "photon-transfer");
  EXPECT_EQ(CountOf(charts, "model\""), 0u);
  EXPECT_EQ(CountOf(charts, "class=\"hollow null\""), 2 * used + 1);
}

TEST(SensorReport, DrawsEveryCurve) {
  const std::string curves = SectionOf(Render(SampleSensorDiagnosis()), "curves");
  EXPECT_EQ(CountOf(curves, "<svg"), 2u);
  EXPECT_THAT(curves, HasSubstr("<h3>Gain of rows</h3>"));
  EXPECT_THAT(curves, HasSubstr("row [px]"));
  EXPECT_THAT(curves, HasSubstr("part lost [%]"));
  // Dots of few values only; one curve has a band.
  EXPECT_EQ(CountOf(curves, "class=\"dot model\""), 11u);
  EXPECT_EQ(CountOf(curves, "class=\"band model\""), 1u);
}

TEST(SensorReport, ComparesQuantitiesWithTheStandard) {
  const std::string table = SectionOf(Render(SampleSensorDiagnosis()), "quantities");
  for (const char* text :
       {"Overall system gain", "<code>gain_dn_per_electron</code>",
        "<strong>0.12530\u202fDN/e\u207b</strong>", "0.12490\u202f\u2026\u202f0.12570",
        "<strong>1.210\u202f%</strong>", "13.33\u202fe\u207b", "EMVA 1288: 6.6",
        "Photons are those of the data file.", "All dark steps have one exposure time."}) {
    EXPECT_THAT(table, HasSubstr(text));
  }
  EXPECT_THAT(table, HasSubstr("<strong>\u2013</strong></td><td>\u2013</td><td>\u2013</td>"));
}

TEST(SensorReport, HasNoEmptySections) {
  const std::string html = Render(v1::SensorDiagnosis());
  EXPECT_EQ(CountOf(html, "<section"), 0u);
  EXPECT_EQ(CountOf(html, "<svg"), 0u);
  v1::SensorDiagnosis bare;
  bare.add_quantities();
  bare.add_departures()->set_found(true);
  bare.add_departures();
  bare.add_photon_transfer();
  bare.add_curves();
  Render(bare);
}

TEST(SensorReport, EscapesEveryText) {
  v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
  SetAllTexts(&diagnosis, "<script>alert('x')</script>&\"_^");
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
}

TEST(SensorReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
    SetAllNumbers(&diagnosis, value);
    Render(diagnosis);
  }
}

TEST(SensorReport, LoadsNothingAndRunsNothing) {
  const std::string html = Render(SampleSensorDiagnosis());
  EXPECT_EQ(OutsideReference(html), "");
}

TEST(SensorReport, RefusesListsThatDoNotFitTogether) {
  v1::SensorDiagnosis diagnosis = SampleSensorDiagnosis();
  diagnosis.mutable_curves(1)->add_standard_errors(1);
  auto html = RenderSensorReport(diagnosis);
  EXPECT_EQ(html.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(html.status().message()),
              HasSubstr("curves[1].standard_errors has size 12, must be 11"));
  diagnosis = SampleSensorDiagnosis();
  diagnosis.mutable_curves(0)->add_abscissa_values(1);
  html = RenderSensorReport(diagnosis);
  EXPECT_THAT(std::string(html.status().message()),
              HasSubstr("curves[0].abscissa_values has size 481, must be 480"));
}

TEST(SensorReport, IsWrittenAsAFile) {
  std::string folder = "/tmp/sightline-sensor-report-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string path = folder + "/report.html";
  ASSERT_TRUE(WriteSensorReport(SampleSensorDiagnosis(), path).ok());
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(), Render(SampleSensorDiagnosis()));
  EXPECT_FALSE(WriteSensorReport(SampleSensorDiagnosis(), folder + "/none/report.html").ok());
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sightline
