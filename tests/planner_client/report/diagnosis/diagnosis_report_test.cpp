// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/diagnosis_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "planner_client/report/page/html.h"
#include "tests/planner_client/report/diagnosis/sample_diagnosis.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostileText[] = "<script>alert('x')</script>&\"_^";

std::string Render(const v1::Diagnosis& diagnosis) {
  const auto html = RenderDiagnosisReport(diagnosis, "");
  EXPECT_TRUE(html.ok()) << html.status();
  EXPECT_EQ(MarkupFault(html.value_or("")), "");
  return html.value_or("");
}

TEST(DiagnosisReport, LeadsWithTheFinding) {
  const std::string html = Render(SampleDiagnosis());
  EXPECT_THAT(html, HasSubstr("<h1>About 5 % of the light lies in a halo around the line: veiling "
                              "glare of the lens.</h1>"));
  EXPECT_THAT(html, HasSubstr("<strong>Veiling glare</strong>, with a probability of "
                              "91.2\u202f%. It shows in: background, line flanks. It depends on: "
                              "signal level."));
  EXPECT_THAT(html, HasSubstr("3.12 \u2192 1.04"));
  EXPECT_THAT(html, HasSubstr("p = 0.19"));
  EXPECT_THAT(html, HasSubstr("Recording 12 holds even numbers only"));
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
  EXPECT_THAT(Render(diagnosis), Not(HasSubstr("Does it predict?")));
  diagnosis.mutable_null_check()->set_p_value(1e-9);
  *diagnosis.mutable_null_check()->add_groups() = Group("profile", 900, 300, 1e-12);
  *diagnosis.mutable_null_check()->add_groups() = Group(kHostileText, 110, 100, 0.2);
  diagnosis.mutable_named_check()->set_p_value(0.31);
  diagnosis.mutable_named_check()->set_log_score_gain(412.3);
  *diagnosis.mutable_named_check()->add_groups() = Group("profile", 310, 300, 0.3);
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, HasSubstr("Does it predict?"));
  EXPECT_THAT(html, HasSubstr("again: the prediction fails (p &lt;"));
  EXPECT_THAT(html, HasSubstr("Veiling glare: the prediction holds (p = 0.31), log density of the "
                              "recordings +412.3 nats"));
  EXPECT_THAT(html, HasSubstr(">profile</td>"));
  EXPECT_THAT(html, Not(HasSubstr(kHostileText)));
  diagnosis.add_part_of_it()->set_effect("optics.field_curvature");
  EXPECT_THAT(Render(diagnosis), HasSubstr("A part of what is missing: Field curvature"));
}

TEST(DiagnosisReport, SaysEverythingTheDiagnosisHolds) {
  const v1::Diagnosis diagnosis = SampleDiagnosis();
  const std::string html = Render(diagnosis);
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    EXPECT_THAT(html, HasSubstr(EscapeHtml(explanation.reason())));
  }
  for (const char* text : {
           "glare fraction <strong>5.12\u202f\u00b1\u202f0.21\u202f%</strong>",
           "halo radius <strong>0.212\u202f\u00b1\u202f0.014\u202fmm</strong>",
           "Ambient light + Dark current",
           "gradient u <span class=\"soft\">not determined by these recordings</span>",
           "Something not in the vocabulary",
           "Nothing left out",
           "all others",
           "from <strong>Lens reflection</strong>",
           "a halo of the lens keeps its size on the sensor",
           "<strong>3.4</strong> bits",
           "temporal noise",
           "420 dof, never fitted",
           "1.10\u202f\u00b1\u202f0.60\u202fmm (stated \u00b12\u202fmm)",
           ">optics<",
           ">139<",
           ("<em>exposure time</em> <em>\u00b7 f-number<sup>\u22122</sup></em> (0.031 at "
            "exposure time 5.1\u202fms, f-number 8)"),
           "0.980\u202f\u00b1\u202f0.040",
           "distance from line [mm]",
           "410\u202f\u00b5W/(m\u00b2 sr)",
           "at the halo radius found",
           "Recording 34 (aperture)",
           "f/2.8, 9.8\u202fms, camera 400\u202fmm, focus 366\u202fmm",
           "not used in fitting",
           "glare_fraction = 0.0512, halo_radius_m = 0.000212",
           "seed 1",
       }) {
    EXPECT_THAT(html, HasSubstr(text));
  }
}

TEST(DiagnosisReport, DrawsProfilesMapsAndBarsBeforeAndAfter) {
  const v1::Diagnosis diagnosis = SampleDiagnosis();
  const std::string html = Render(diagnosis);
  // Signal and residual of four recordings, and the key.
  EXPECT_EQ(CountOf(html, "class=\"line dashed null\""), 4u * 2 + 1);
  EXPECT_EQ(CountOf(html, "class=\"line model\""), 4u * 2 + 1 + 1);  // and the free-form curve
  EXPECT_EQ(CountOf(html, "svg class=\"chart map\""), 4u * 2);
  EXPECT_EQ(CountOf(html, "class=\"bar null\""), 44u);
  EXPECT_EQ(CountOf(html, "class=\"bar model\""), 44u);
  // A ratio of 1.25 is an error of 1 - 1/1.25 (thesis, eq. 5.7).
  v1::Diagnosis one = diagnosis;
  one.mutable_null_fit()->mutable_recordings(1)->set_intensity_ratio(1.25);
  EXPECT_THAT(Render(one), HasSubstr("e\u1d62 20\u202f%"));
}

// Of a part tiles of every recording are held out; maps are the picture, the image comes first.
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
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, HasSubstr("The picture that shows it"));
  EXPECT_THAT(html, Not(HasSubstr("Where in the image")));
  EXPECT_THAT(html, Not(HasSubstr("recording not used in fitting")));
  EXPECT_THAT(html, Not(HasSubstr("class=\"badge\"")));
  EXPECT_THAT(html, HasSubstr("tiles not used in fitting"));
  EXPECT_THAT(html, Not(HasSubstr("all recordings")));
  EXPECT_THAT(html, HasSubstr("rows 24-183, columns 72-239, surface &quot;sand_cast&quot;"));
  // A shape that was chosen, not fitted, has a range without a probability.
  EXPECT_THAT(html, HasSubstr("<strong>0.200\u202fmm</strong>"));
  EXPECT_THAT(html, HasSubstr("(0.100\u202f\u2026\u202f0.400\u202fmm)"));
}

TEST(DiagnosisReport, ShowsNoSecondModelWithoutAnEffect) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.set_verdict("none");
  diagnosis.clear_free_form();
  diagnosis.mutable_ranked()->SwapElements(0, 4);
  diagnosis.mutable_ranked(0)->set_probability(0.97);
  diagnosis.clear_finding();
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, HasSubstr("<h1>The recordings agree with the nominal description.</h1>"));
  EXPECT_THAT(html, HasSubstr("none <small>97.0\u202f%</small>"));
  EXPECT_THAT(html, Not(HasSubstr("class=\"line model\"")));
  EXPECT_THAT(html, Not(HasSubstr("class=\"bar model\"")));
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
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, HasSubstr("1.25\u202f\u00b1\u202f0.10\u202fpx"));
  EXPECT_THAT(html, HasSubstr("\u22120.40\u202f\u00b1\u202f0.10\u00b0"));
  EXPECT_THAT(html, HasSubstr("not needed"));
}

TEST(DiagnosisReport, SaysThatThereIsNoDependence) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.clear_laws();
  v1::SetupLaw* law = diagnosis.add_laws();
  law->set_quantity("none");
  law->set_law("no dependence found");
  EXPECT_THAT(Render(diagnosis), HasSubstr("<p>no dependence found</p>"));
}

TEST(DiagnosisReport, NamesTheStageOfTheUnknown) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  diagnosis.mutable_ranked()->SwapElements(0, 3);
  diagnosis.mutable_ranked(0)->add_effects()->set_effect("unknown.response");
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, HasSubstr("Something not in the vocabulary (Response)"));
  EXPECT_THAT(html, HasSubstr("with the missing term"));
}

TEST(DiagnosisReport, HasNoEmptySections) {
  const std::string html = Render(v1::Diagnosis());
  EXPECT_EQ(CountOf(html, "<section"), 1u);  // how to get it again
  EXPECT_EQ(CountOf(html, "<table"), 0u);
  EXPECT_EQ(CountOf(html, "<svg"), 0u);
  // Every list on its own may be missing, or hold messages without any field.
  const v1::Diagnosis full = SampleDiagnosis();
  const auto* descriptor = v1::Diagnosis::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    v1::Diagnosis diagnosis = full;
    diagnosis.GetReflection()->ClearField(&diagnosis, descriptor->field(i));
    Render(diagnosis);
    if (!descriptor->field(i)->is_repeated() ||
        descriptor->field(i)->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) {
      continue;
    }
    diagnosis.GetReflection()->AddMessage(&diagnosis, descriptor->field(i));
    Render(diagnosis);
  }
}

TEST(DiagnosisReport, EscapesEveryText) {
  v1::Diagnosis diagnosis = SampleDiagnosis();
  SetAllTexts(&diagnosis, kHostileText);
  (*diagnosis.mutable_calibrated_effects(0)->mutable_parameters())[kHostileText] = 1;
  const std::string html = Render(diagnosis);
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
}

TEST(DiagnosisReport, SurvivesNumbersThatAreNone) {
  for (const double value : kOddNumbers) {
    v1::Diagnosis diagnosis = SampleDiagnosis();
    SetAllNumbers(&diagnosis, value);
    for (v1::RegionMap& map : *diagnosis.mutable_region_maps()) {
      map.clear_row_edges_px();
      map.clear_column_edges_px();
    }
    Render(diagnosis);
  }
}

TEST(DiagnosisReport, LoadsNothingAndRunsNothing) {
  const std::string html = Render(SampleDiagnosis());
  EXPECT_THAT(html, HasSubstr("default-src 'none'; img-src data:; style-src 'unsafe-inline'"));
  EXPECT_EQ(OutsideReference(html), "");
}

TEST(DiagnosisReport, RefusesListsThatDoNotFitTogether) {
  const auto message = [](const v1::Diagnosis& diagnosis) {
    const auto html = RenderDiagnosisReport(diagnosis, "");
    EXPECT_EQ(html.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(html.status().message());
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

TEST(DiagnosisReport, IsWrittenAsItIsRendered) {
  const std::string path = ::testing::TempDir() + "/diagnosis_report_test.html";
  ASSERT_TRUE(WriteDiagnosisReport(SampleDiagnosis(), "", path).ok());
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  EXPECT_EQ(text.str(), Render(SampleDiagnosis()));
  std::filesystem::remove(path);
  EXPECT_FALSE(WriteDiagnosisReport(SampleDiagnosis(), "", "/no/such/folder/report.html").ok());
}

}  // namespace
}  // namespace sightline
