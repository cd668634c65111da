// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/diagnosis_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include "core/json/strict_json.h"
#include "report/document/report_page.h"
#include "tests/report/diagnosis/sample_diagnosis.h"
#include "tests/report/report_reading.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

using Mark = v1::ReportSeries;

v1::Report Made(const v1::Diagnosis& diagnosis) {
  auto report = DiagnosisReport(diagnosis, "");
  EXPECT_TRUE(report.ok()) << report.status();
  if (!report.ok()) return {};
  EXPECT_EQ(ReportFault(*report), "");
  return *report;
}

TEST(DiagnosisReport, LeadsWithTheFinding) {
  const v1::Report report = Made(SampleDiagnosis());
  EXPECT_EQ(report.heading(),
            "About 5 % of the light lies in a halo around the line: veiling glare of the lens.");
  EXPECT_THAT(FindingOf(report),
              HasSubstr("Veiling glare, with a probability of 91.2\u202f%. It shows in: "
                        "background, line flanks. It depends on: signal level."));
  EXPECT_TRUE(report.finding(0).strong());
  EXPECT_THAT(TextOf(report), HasSubstr("3.12 \u2192 1.04"));
  EXPECT_THAT(TextOf(report), HasSubstr("p = 0.19"));
  ASSERT_GE(report.warnings_size(), 1);
  EXPECT_THAT(report.warnings(0), HasSubstr("Recording 12 holds even numbers only"));
}

TEST(DiagnosisReport, WhatIsLeftStandsBelowTheHeading) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.set_finding("The recordings show a halo.\n2 % <left>.");
  const v1::Report report = Made(diagnosis);
  EXPECT_EQ(report.heading(), "The recordings show a halo.");
  EXPECT_TRUE(FindingOf(report).ends_with(" 2 % <left>."));
}

TEST(DiagnosisReport, ShowsTheTermsOfTheEvidence) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  EXPECT_THAT(TextOf(Made(diagnosis)), Not(HasSubstr("term by term")));
  v1::Evidence* terms = diagnosis.mutable_ranked(0)->mutable_evidence();
  terms->set_fit_nats(161.2);
  terms->set_covariance_nats(-9.4);
  terms->set_curvature_nats(-6.1);
  terms->set_parameter_prior_nats(-2.5);
  terms->set_model_prior_nats(-3.7);
  const auto tables = TablesOf(SectionOf(Made(diagnosis), "explanations"));
  ASSERT_EQ(tables.size(), 2u);
  EXPECT_EQ(tables[1].title(), "The evidence, term by term");
  ASSERT_EQ(tables[1].rows_size(), 1);
  const std::pair<const char*, double> expected[] = {{"161", 161.2},
                                                     {"\u22129.4", -9.4},
                                                     {"\u22126.1", -6.1},
                                                     {"\u22122.5", -2.5},
                                                     {"\u22123.7", -3.7}};
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(tables[1].rows(0).cells(i + 1).text(), expected[i].first);
    EXPECT_EQ(tables[1].rows(0).cells(i + 1).number(), expected[i].second);
  }
}

v1::PredictedGroup Group(const std::string& name, double chi_squared, int numbers, double p) {
  v1::PredictedGroup group;
  group.set_name(name);
  group.set_chi_squared(chi_squared);
  group.set_degrees_of_freedom(numbers);
  group.set_p_value(p);
  return group;
}

TEST(DiagnosisReport, SaysWhetherRecordingsNotFittedArePredicted) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  EXPECT_EQ(SectionOf(Made(diagnosis), "prediction").sections_size(), 0);
  diagnosis.mutable_null_check()->set_p_value(1e-9);
  *diagnosis.mutable_null_check()->add_groups() = Group("profile", 900, 300, 1e-12);
  *diagnosis.mutable_null_check()->add_groups() = Group("line_position", 110, 100, 0.2);
  diagnosis.mutable_named_check()->set_p_value(0.31);
  diagnosis.mutable_named_check()->set_log_score_gain(412.3);
  *diagnosis.mutable_named_check()->add_groups() = Group("profile", 310, 300, 0.3);
  const v1::Report report = Made(diagnosis);
  const std::string text = TextOf(SectionOf(report, "prediction"));
  EXPECT_THAT(text, HasSubstr("again: the prediction fails (p <"));
  EXPECT_THAT(text, HasSubstr("Veiling glare: the prediction holds (p = 0.31), log density of the "
                              "recordings +412.3 nats"));
  const v1::ReportTable table = FirstTableOf(report, "prediction");
  EXPECT_EQ(CellOf(table, "profile", "\u03c7\u00b2 per number, nominal").number(), 3);
  EXPECT_EQ(CellOf(table, "line_position", "\u03c7\u00b2 per number, nominal").number(), 1.1);
  EXPECT_EQ(CellOf(table, "line_position", "with Veiling glare").text(), "\u2013");
  diagnosis.add_part_of_it()->set_effect("optics.field_curvature");
  EXPECT_THAT(TextOf(Made(diagnosis)), HasSubstr("A part of what is missing: Field curvature"));
}

TEST(DiagnosisReport, SaysEverythingTheDiagnosisHolds) {
  const v1::Diagnosis diagnosis = SampleDiagnosis();
  const std::string texts = TextOf(Made(diagnosis));
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    EXPECT_THAT(texts, HasSubstr(explanation.reason()));
  }
  for (const char* text : {
           "glare fraction 5.12\u202f\u00b1\u202f0.21\u202f%",
           "halo radius 0.212\u202f\u00b1\u202f0.014\u202fmm",
           "Ambient light + Dark current",
           "gradient u not determined by these recordings",
           "Something not in the vocabulary",
           "Nothing left out",
           "all others",
           "Lens reflection",
           "a halo of the lens keeps its size on the sensor",
           "temporal noise",
           "420 dof, never fitted",
           "1.10\u202f\u00b1\u202f0.60\u202fmm (stated \u00b12\u202fmm)",
           "\noptics\n",
           "\n139\n",
           ("exposure time \u00b7 f-number\u207b\u00b2 (0.031 at exposure time 5.1\u202fms, "
            "f-number 8)"),
           "0.980\u202f\u00b1\u202f0.040",
           "distance from line\nmm\n",
           "410\u202f\u00b5W/(m\u00b2 sr)",
           "at the halo radius found",
           "Recording 34 (aperture)",
           "f/2.8, 9.8\u202fms, camera 400\u202fmm, focus 366\u202fmm",
           "not used in fitting",
           "glare_fraction = 0.0512, halo_radius_m = 0.000212",
           "seed 1",
       }) {
    EXPECT_THAT(texts, HasSubstr(text));
  }
  const v1::ReportTable next = FirstTableOf(Made(diagnosis), "next");
  EXPECT_EQ(next.rows(0).cells(2).text(), "3.4");
  EXPECT_EQ(next.rows(0).cells(2).number(), diagnosis.next_recordings(0).expected_gain_bits());
  const v1::ReportTable table = FirstTableOf(Made(diagnosis), "explanations");
  EXPECT_EQ(CellOf(table, "Veiling glare", "probability").number(),
            diagnosis.ranked(0).probability());
}

TEST(DiagnosisReport, DrawsProfilesMapsAndBarsBeforeAndAfter) {
  const v1::Diagnosis diagnosis = SampleDiagnosis();
  const v1::Report report = Made(diagnosis);
  const auto profiles = ChartsOf(SectionOf(report, "profiles"));
  // Signal and residual of four recordings.
  ASSERT_EQ(profiles.size(), 4u * 2);
  for (const v1::ReportChart& chart : profiles) {
    EXPECT_GT(PointsOf(chart, v1::REPORT_COLOUR_REFERENCE, Mark::DASHED_LINE), 0);
    EXPECT_GT(PointsOf(chart, v1::REPORT_COLOUR_MODEL, Mark::LINE), 0);
  }
  EXPECT_EQ(MapsOf(report).size(), 4u * 2);
  const auto fits = ChartsOf(SectionOf(report, "fit"));
  ASSERT_EQ(fits.size(), 3u);
  EXPECT_EQ(fits[1].kind(), v1::ReportChart::BARS);
  ASSERT_EQ(fits[1].series_size(), 2);
  EXPECT_EQ(fits[1].series(0).y_size(), 44);
  EXPECT_EQ(fits[1].series(1).y_size(), 44);
  EXPECT_EQ(fits[1].x().categories_size(), 44);
  // A ratio of 1.25 is an error of 1 - 1/1.25 (thesis, eq. 5.7).
  v1::Diagnosis one = diagnosis;
  one.mutable_null_fit()->mutable_recordings(1)->set_intensity_ratio(1.25);
  const v1::ReportChart intensity = ChartsOf(SectionOf(Made(one), "fit"))[2];
  int found = 0;
  for (int i = 0; i < intensity.series(0).x_size(); ++i) {
    if (intensity.series(0).x(i) != one.null_fit().recordings(1).recording()) continue;
    EXPECT_NEAR(intensity.series(0).y(i), 20, 1e-9);
    ++found;
  }
  EXPECT_EQ(found, 1);
  EXPECT_EQ(intensity.y().unit(), "%");
}

// For a part, tiles of every recording are held out; maps are the picture, the image comes first.
TEST(DiagnosisReport, OfAPart) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.clear_profiles();
  diagnosis.mutable_calibrated()->set_format_version(2);
  diagnosis.mutable_calibrated()->mutable_recordings()->DeleteSubrange(2, 42);
  diagnosis.mutable_region_maps()->DeleteSubrange(1, 3);
  diagnosis.mutable_region_maps(0)->set_recording(1);
  diagnosis.mutable_held_out_improvement()->clear_recordings();
  for (v1::ModelFit* fit : {diagnosis.mutable_null_fit(), diagnosis.mutable_model_fit()}) {
    fit->clear_recordings();
    for (int recording = 0; recording < 2; ++recording) {
      diagnosis.mutable_held_out_improvement()->add_recordings(recording);
      for (const bool held_out : {false, true}) {
        v1::RecordingFit* entry = fit->add_recordings();
        entry->set_recording(recording);
        entry->set_held_out(held_out);
        entry->set_chi_squared(100);
        entry->set_degrees_of_freedom(80);
      }
    }
  }
  v1::FittedEffect* effect = diagnosis.mutable_ranked(0)->mutable_effects(0);
  effect->clear_regions();
  effect->add_regions("images/001.png: rows 24-183, columns 72-239");
  effect->add_regions("surface \"sand_cast\" (100 %)");
  v1::FittedParameter* shape = effect->mutable_parameters(1);
  shape->clear_standard_error();
  shape->set_value(2e-4);
  shape->set_lower(1e-4);
  shape->set_upper(4e-4);
  const std::string text = TextOf(Made(diagnosis));
  EXPECT_THAT(text, HasSubstr("The picture that shows it"));
  EXPECT_THAT(text, Not(HasSubstr("Where in the image")));
  EXPECT_THAT(text, Not(HasSubstr(", not used in fitting")));
  EXPECT_THAT(text, Not(HasSubstr("recording not used in fitting")));
  EXPECT_THAT(text, HasSubstr("tiles not used in fitting"));
  EXPECT_THAT(text, Not(HasSubstr("all recordings")));
  EXPECT_THAT(text, HasSubstr("rows 24-183, columns 72-239, surface \"sand_cast\""));
  // A shape that was chosen, not fitted, has a range without a probability.
  EXPECT_THAT(text, HasSubstr("0.200\u202fmm (0.100\u202f\u2026\u202f0.400\u202fmm)"));
}

TEST(DiagnosisReport, ShowsNoSecondModelWithoutAnEffect) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.set_verdict("none");
  diagnosis.clear_free_form();
  diagnosis.mutable_ranked()->SwapElements(0, 4);
  diagnosis.mutable_ranked(0)->set_probability(0.97);
  diagnosis.clear_finding();
  const v1::Report report = Made(diagnosis);
  EXPECT_EQ(report.heading(), "The recordings agree with the nominal description.");
  EXPECT_EQ(report.figures(0).text(), "none");
  EXPECT_EQ(report.figures(0).detail(), "97.0\u202f%");
  for (const v1::ReportChart& chart : ChartsOf(report)) {
    for (const v1::ReportSeries& series : chart.series()) {
      EXPECT_NE(series.colour(), v1::REPORT_COLOUR_MODEL);
    }
  }
}

TEST(DiagnosisReport, ListsCoefficientsOfTermsWithoutACurve) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  v1::FreeFormTerm* term = diagnosis.mutable_free_form();
  term->Clear();
  term->set_stage("geometry");
  term->set_abscissa("coefficient: shift_px, roll_deg, bow_m");
  for (const double value : {1.25, -0.4, 0.0}) {
    term->add_values(value);
    term->add_abscissa_values(term->values_size() - 1);
    term->add_standard_errors(value == 0 ? 0 : 0.1);
  }
  const v1::ReportTable table = FirstTableOf(Made(diagnosis), "free-form");
  EXPECT_EQ(CellOf(table, "shift", "value").text(), "1.25\u202f\u00b1\u202f0.10\u202fpx");
  EXPECT_EQ(CellOf(table, "roll", "value").text(), "\u22120.40\u202f\u00b1\u202f0.10\u00b0");
  EXPECT_EQ(CellOf(table, "bow", "value").text(), "not needed");
}

TEST(DiagnosisReport, SaysThatThereIsNoDependence) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.clear_laws();
  v1::SetupLaw* law = diagnosis.add_laws();
  law->set_quantity("none");
  law->set_law("no dependence found");
  EXPECT_THAT(TextOf(SectionOf(Made(diagnosis), "laws")), HasSubstr("\nno dependence found\n"));
}

TEST(DiagnosisReport, NamesTheStageOfTheUnknown) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.mutable_ranked()->SwapElements(0, 3);
  diagnosis.mutable_ranked(0)->add_effects()->set_effect("unknown.response");
  const std::string text = TextOf(Made(diagnosis));
  EXPECT_THAT(text, HasSubstr("Something not in the vocabulary (Response)"));
  EXPECT_THAT(text, HasSubstr("with the missing term"));
}

TEST(DiagnosisReport, HasNoEmptySections) {
  const v1::Report report = Made(v1::Diagnosis());
  EXPECT_EQ(report.sections_size(), 1);  // how to get it again
  EXPECT_EQ(TablesOf(report).size() + ChartsOf(report).size(), 0u);
  // Every list on its own may be missing, or hold messages without any field.
  const v1::Diagnosis full = SampleDiagnosis();
  const auto* descriptor = v1::Diagnosis::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    v1::Diagnosis diagnosis = full;
    diagnosis.GetReflection()->ClearField(&diagnosis, descriptor->field(i));
    Made(diagnosis);
    if (!descriptor->field(i)->is_repeated() ||
        descriptor->field(i)->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) {
      continue;
    }
    diagnosis.GetReflection()->AddMessage(&diagnosis, descriptor->field(i));
    Made(diagnosis);
  }
}

TEST(DiagnosisReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::Diagnosis diagnosis = SampleDiagnosis();
    SetAllNumbers(&diagnosis, value);
    for (v1::RegionMap& map : *diagnosis.mutable_region_maps()) {
      map.clear_row_edges_px();
      map.clear_column_edges_px();
    }
    Made(diagnosis);
  }
}

TEST(DiagnosisReport, RefusesListsThatDoNotFitTogether) {
  const auto message = [](const v1::Diagnosis& diagnosis) {
    const auto report = DiagnosisReport(diagnosis, "");
    EXPECT_EQ(report.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(report.status().message());
  };
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.mutable_profiles(1)->add_model_dn(0);
  EXPECT_THAT(message(diagnosis), HasSubstr("profiles[1].model_dn has size"));
  diagnosis = SampleDiagnosis();
  diagnosis.mutable_profiles(0)->clear_observed_dn();
  EXPECT_THAT(message(diagnosis), HasSubstr("profiles[0].observed_dn has size 0"));
  diagnosis = SampleDiagnosis();
  diagnosis.mutable_region_maps(2)->set_columns(13);
  EXPECT_THAT(message(diagnosis),
              HasSubstr("region_maps[2].null_z has size 384, must be 416 (rows x columns)"));
  diagnosis = SampleDiagnosis();
  diagnosis.mutable_region_maps(2)->set_row_edges_px(3, 1000);
  EXPECT_THAT(message(diagnosis), HasSubstr("region_maps[2].row_edges_px[4] is 32"));
  diagnosis = SampleDiagnosis();
  diagnosis.mutable_free_form()->add_values(1);
  EXPECT_THAT(message(diagnosis), HasSubstr("free_form.abscissa_values has size 20, must be 21"));
}

TEST(DiagnosisReport, IsWrittenAsPageAndData) {
  const std::string folder = ::testing::TempDir() + "/diagnosis_report_test";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(WriteDiagnosisReport(SampleDiagnosis(), "", folder + "/report.html").ok());
  const auto bytes = [](const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  };
  const v1::Report report = Made(SampleDiagnosis());
  EXPECT_EQ(bytes(folder + "/report.html"), ReportPage(report, "report.json"));
  EXPECT_EQ(bytes(folder + "/report.json"), ToJson(report));
  std::filesystem::remove_all(folder);
  EXPECT_FALSE(WriteDiagnosisReport(SampleDiagnosis(), "", "/no/such/folder/report.html").ok());
}

}  // namespace
}  // namespace sightline
