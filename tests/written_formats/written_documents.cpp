// SPDX-License-Identifier: Apache-2.0
// written_documents FOLDER: writes one document of every format and form that Sightline's libraries
// write, from the samples of their tests. written_formats_test.py has a validator for every ending.
//
// A new writer joins by a line in Documents().
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "planner_client/exports/export_files.h"
#include "planner_client/setup_sheet/setup_sheet.h"
#include "planning_service/http_api/openapi.h"
#include "report/diagnosis/diagnosis_report.h"
#include "report/document/report_page.h"
#include "report/optics/optics_report.h"
#include "report/plan/plan_csv.h"
#include "report/plan/report.h"
#include "report/sensor/sensor_report.h"
#include "report/uncertainty/qif_export.h"
#include "report/uncertainty/uncertainty_ply.h"
#include "report/verification/verification_report.h"
#include "tests/planner_client/exports/sample_plan.h"
#include "tests/report/diagnosis/sample_diagnosis.h"
#include "tests/report/optics/sample_optics.h"
#include "tests/report/recordings/sample_sensor.h"
#include "tests/report/uncertainty/sample_uncertainty.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

// --- samples beyond those of the writers' own tests --------------------------------------------

// A plan with everything that a report has a section for.
ReportData FullReport() {
  ReportData data = SampleUncertaintyPlan();
  v1::Plan& plan = data.plan;
  for (int i = 0; i < plan.scans_size(); ++i) {
    v1::PlannedScan& scan = *plan.mutable_scans(i);
    if (i == 0) scan.mutable_quality()->mutable_depth_per_pixel_m()->set_median(0.000345);
    scan.set_resting_face(0);
    scan.add_remarks("an angle of 85 deg > 80 deg is unusual");
    scan.mutable_robot()->set_reachable(i == 0);
    scan.mutable_robot()->add_start_position(0.1);
    scan.mutable_robot()->add_start_position(0.2);
    scan.mutable_robot()->add_end_position(0.1);
    scan.mutable_robot()->add_end_position(0.3);
  }
  v1::RestingFace& face = *plan.add_resting_faces();
  face.set_name("A");
  face.mutable_normal()->set_z(-1);
  face.set_stability_deg(31.4);
  ReportRobot robot;
  robot.name = "robot \"R\"";
  robot.joints = {{"base", true}, {"slide", false}};
  robot.scans.resize(data.scans.size());
  data.robot = robot;
  v1::AsMeasured& found = *plan.mutable_as_measured();
  found.add_scans()->set_file("points/scan_01.ply");
  data.comparison = ComparisonTable{{0.9, 0.95}, {{"greedy", 3, {{2, 1, 3, 3}, {4, 4, 4, 1}}}}};
  v1::ParetoFront front;
  for (int i = 1; i <= 3; ++i) {
    v1::ParetoPoint& point = *front.add_points();
    point.set_number(i);
    point.set_scans(i);
    point.set_time_s(10 * i);
    point.set_settled(0.3 * i);
  }
  data.pareto = front;
  data.reasons.assign(data.targets.size(), TargetReason{v1::UNCOVERED_REASON_NOT_CHOSEN, -1});
  data.timings = {{"search", 12.5}, {"bound", 3}};
  data.notes = {"a note with <tags> & signs"};
  data.set_up_sheet = "setup.html";
  return data;
}

SetUpSheet Sheet() {
  SetUpSheet sheet;
  sheet.plan = SamplePlan();
  sheet.part_name = "bracket & co.stl";
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d half(corner & 1 ? 0.05 : -0.05, corner & 2 ? 0.03 : -0.03,
                               corner & 4 ? 0.02 : -0.02);
    sheet.mesh.positions_m.push_back((kSampleCentre_m + half).cast<float>());
  }
  sheet.pictures_png.resize(static_cast<size_t>(sheet.plan.scans_size()));
  v1::RestingFace& face = *sheet.plan.add_resting_faces();
  face.set_name("A");
  face.mutable_normal()->set_z(-1);
  sheet.plan.mutable_scans(0)->set_resting_face(0);
  return sheet;
}

// A plan with a feature of every kind of tolerance, and the drawing's tolerances for it.
enum class Drawing { kNone, kLimits, kEverything };
absl::StatusOr<std::string> QifOfEveryKind(Drawing drawing) {
  v1::Plan plan;
  std::vector<Tolerance> tolerances;
  for (int k = 0; k <= static_cast<int>(ToleranceKind::kAngularDistance); ++k) {
    const auto kind = static_cast<ToleranceKind>(k);
    v1::FeatureVerdict& feature = *plan.mutable_uncertainty()->add_features();
    feature.set_id(absl::StrCat("#", k));
    feature.set_name(absl::StrCat("f", k));
    feature.set_kind(ToleranceKindName(kind));
    if (!IsAngular(kind)) feature.set_zone_width_m(1e-5 * (k + 1));
    // Every other one has figures.
    feature.set_verdict(k % 2 == 0 ? v1::FeatureVerdict::NOT_EVALUATED
                                   : v1::FeatureVerdict::CANNOT_BE_PROVEN);
    feature.set_because(k % 2 == 0 ? "not evaluated: its datum A binds no face"
                                   : "cannot be proven: no acceptance zone is left");
    if (k % 2 == 1) feature.set_uncertainty_m(1e-5);
    if (drawing == Drawing::kNone) continue;
    Tolerance tolerance;
    tolerance.id = feature.id();
    tolerance.nominal_m = tolerance.lower_m = 0.01;
    tolerance.upper_m = 0.01 + feature.zone_width_m();
    if (drawing == Drawing::kEverything) {
      tolerance.diameter_zone = true;
      tolerance.text = "position\t\"x\" <a>\nb";
      tolerance.modifiers = {"maximum material requirement", "width"};
      tolerance.datums = {"A", "B(M)"};
    }
    tolerances.push_back(tolerance);
  }
  plan.mutable_uncertainty()->mutable_tolerances()->set_read(plan.uncertainty().features_size());
  return QifDocument(plan, "plate.glb", tolerances);
}

absl::StatusOr<std::string> QifWithNumbers(double value) {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  SetAllNumbers(&plan, value);
  return QifDocument(plan, "plate.glb");
}

absl::StatusOr<std::string> QifWithTexts(const std::string& text) {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  SetAllTexts(&plan, text);
  return QifDocument(plan, text);
}

// Results of every kind, with and without values.
absl::StatusOr<std::string> QifResultsOfEveryKind() {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  plan.mutable_uncertainty()->clear_features();
  v1::InspectionResult measured;
  for (int kind = 0; kind <= static_cast<int>(ToleranceKind::kAngularDistance); ++kind) {
    for (int decision = 1; decision <= 4; ++decision) {
      v1::FeatureVerdict& verdict = *plan.mutable_uncertainty()->add_features();
      verdict.set_name(absl::StrCat("feature ", kind));
      verdict.set_kind(ToleranceKindName(static_cast<ToleranceKind>(kind)));
      verdict.set_zone_width_m(1e-4);
      v1::InspectedFeature& feature = *measured.add_features();
      feature.set_decision(static_cast<v1::InspectedFeature::Decision>(decision));
      feature.set_because("a < b & c");
      if (decision == 4) continue;
      feature.set_value_m(0.0123);
      feature.set_expanded_uncertainty_m(4e-6);
      feature.set_smallest_deviation_m(-1e-5);
      feature.set_largest_deviation_m(2e-5);
    }
  }
  return QifDocument(plan, "plate.glb", {}, &measured);
}

absl::StatusOr<std::string> QifOfCoverage() {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  plan.clear_uncertainty();
  return QifDocument(plan, "plate.glb");
}

absl::StatusOr<std::string> UncertaintyCloud() {
  const ReportData data = SampleUncertaintyPlan();
  return UncertaintyPly(data.targets, *data.uncertainty, data.measurable);
}

absl::StatusOr<std::string> PageOf(const absl::StatusOr<v1::Report>& report) {
  if (!report.ok()) return report.status();
  return ReportPage(*report, "report.json");
}

absl::StatusOr<std::string> DataOf(const absl::StatusOr<v1::Report>& report) {
  if (!report.ok()) return report.status();
  return ToJson(*report);
}

// --- the table ---------------------------------------------------------------------------------

struct Document {
  std::string name;
  std::function<absl::StatusOr<std::string>()> write;
};

std::vector<Document> Documents() {
  std::vector<Document> documents = {
      {"plan_report.html", [] { return PageOf(PlanReport(SampleUncertaintyPlan())); }},
      {"plan_report.json", [] { return DataOf(PlanReport(SampleUncertaintyPlan())); }},
      {"full_plan_report.html", [] { return PageOf(PlanReport(FullReport())); }},
      {"setup.html", [] { return PageOf(SetUpReport(Sheet())); }},
      {"optics_report.html",
       [] {
         const v1::DeviceChoice devices = SampleDevices();
         return PageOf(OpticsReport(SampleOptics(), &devices));
       }},
      {"diagnosis_report.html", [] { return PageOf(DiagnosisReport(SampleDiagnosis(), "")); }},
      {"sensor_report.html", [] { return PageOf(SensorReport(SampleSensorDiagnosis())); }},
      {"sensor_report.json", [] { return DataOf(SensorReport(SampleSensorDiagnosis())); }},
      {"verification_report.html", [] { return PageOf(VerificationReport(SampleVerification())); }},
      {"plan.csv", [] { return PlanCsv(SamplePlan()); }},
      {"service.openapi.json", [] { return OpenApiJson(); }},
      {"uncertainty.ply", UncertaintyCloud},
      {"plan.qif", [] { return QifDocument(SampleUncertaintyPlan().plan, "plate.glb"); }},
      {"coverage.qif", QifOfCoverage},
      {"results.qif", QifResultsOfEveryKind},
      {"kinds.qif", [] { return QifOfEveryKind(Drawing::kNone); }},
      {"kinds_with_limits.qif", [] { return QifOfEveryKind(Drawing::kLimits); }},
      {"kinds_with_drawing.qif", [] { return QifOfEveryKind(Drawing::kEverything); }},
      {"texts.qif", [] { return QifWithTexts("<a href=\"x\">&amp;]]>'\n\t\x01\xc3\xa4"); }},
      {"spaces.qif", [] { return QifWithTexts("  two  spaces "); }},
      {"no_texts.qif", [] { return QifWithTexts(""); }},
  };
  using Limits = std::numeric_limits<double>;
  for (const double value :
       {Limits::quiet_NaN(), Limits::infinity(), 0.0, -1.0, 1e-300, 1e300, Limits::denorm_min()}) {
    documents.push_back(
        {absl::StrCat("numbers_", value, ".qif"), [value] { return QifWithNumbers(value); }});
  }
  const auto exports = ExportPlan(SamplePlan());
  if (!exports.ok()) {
    documents.push_back({"exports", [status = exports.status()] { return status; }});
    return documents;
  }
  for (const ExportFile& file : *exports) {
    documents.push_back(
        {absl::StrCat("export_", file.name), [text = file.contents] { return text; }});
  }
  return documents;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: written_documents FOLDER\n");
    return 2;
  }
  for (const sightline::Document& document : sightline::Documents()) {
    const auto text = document.write();
    if (!text.ok()) {
      std::fprintf(stderr, "%s: %s\n", document.name.c_str(), text.status().ToString().c_str());
      return 1;
    }
    std::ofstream(std::filesystem::path(argv[1]) / document.name, std::ios::binary) << *text;
  }
  return 0;
}
