// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/file/atomic_write.h"
#include "core/inspection/part_holding.h"
#include "core/inspection/read_with_files.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/inspection/next_scan.h"
#include "planner_client/commands/other_part.h"
#include "planner_client/commands/planning/replanning/as_measured_session.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/inspect/judge_measured.h"
#include "planner_client/inspect/measured_csv.h"
#include "planner_client/part_files/part_file.h"
#include "planning/plan_file/plan_file.h"
#include "report/document/report_page.h"
#include "report/inspection/inspection_report.h"
#include "report/uncertainty/qif_export.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct InspectOptions {
  std::string inspection_file, plan_file, out;
  AsMeasuredOptions measured;
  GivenPlans plans;
  NextScanQuestion next;
  bool next_scan = true;
  std::string fail_on;
};

// The inspection, the part and the plan, read and checked.
struct InspectedPart {
  Inspection inspection;
  std::shared_ptr<const TriangleMesh> mesh;
  PartDigest digest;
  Requirements requirements;
  v1::Plan plan;
  EarlierPlan earlier;
  std::vector<std::string> warnings;
};

absl::StatusOr<InspectedPart> ReadInspectedPart(InspectOptions& options) {
  InspectedPart asked;
  SIGHTLINE_ASSIGN_OR_RETURN(auto plan, ReadPlanScans(options.plan_file, &options.plans));
  asked.plan = std::move(plan.plan);
  asked.earlier.scans = std::move(plan.all);
  SIGHTLINE_ASSIGN_OR_RETURN(
      asked.earlier.files,
      AssignScans(options.measured.files, static_cast<int>(asked.earlier.scans.size())));
  SIGHTLINE_ASSIGN_OR_RETURN(asked.inspection, ReadInspectionWithFiles(options.inspection_file));
  if (!asked.inspection.tolerances || !asked.inspection.uncertainty) {
    return absl::InvalidArgumentError(absl::StrCat(
        options.inspection_file, ": has no ",
        asked.inspection.tolerances ? "uncertainty" : "tolerances",
        "; a verdict needs tolerances (regions or a file) and the uncertainty of the scanner"));
  }
  PartFileOptions part_options;
  part_options.construction_geometry = asked.inspection.part_construction_geometry;
  SIGHTLINE_ASSIGN_OR_RETURN(auto part, LoadPartFile(asked.inspection.part_file,
                                                     asked.inspection.part_unit, part_options));
  asked.digest = PartDigestOf(part);
  SIGHTLINE_ASSIGN_OR_RETURN(asked.warnings,
                             options.plans.CheckBelongTo(asked.digest, asked.inspection.part_file));
  asked.mesh = std::make_shared<const TriangleMesh>(std::move(part));
  DeriveLimits(&asked.inspection);
  SIGHTLINE_RETURN_IF_ERROR(HoldPart(*asked.mesh, &asked.inspection).status());
  SIGHTLINE_ASSIGN_OR_RETURN(auto requirements, ReadRequirements(asked.inspection, *asked.mesh));
  asked.requirements = *std::move(requirements);
  if (asked.requirements.features.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        options.inspection_file,
        ": tolerances bind no feature; give tolerances.regions or a file with tolerances"));
  }
  return asked;
}

// Scans of the plan without points.
void WarnOfMissingScans(const EarlierPlan& earlier, v1::InspectionResult& result) {
  std::string missing;
  for (size_t s = 0; s < earlier.scans.size(); ++s) {
    const bool measured =
        std::any_of(earlier.files.begin(), earlier.files.end(),
                    [&](const MeasuredFile& file) { return file.scan == static_cast<int>(s); });
    if (!measured) absl::StrAppend(&missing, missing.empty() ? "" : ", ", s + 1);
  }
  if (missing.empty()) return;
  result.add_warnings(absl::StrFormat("There are no points of scan %s of the %d scans of the plan.",
                                      missing, earlier.scans.size()));
}

// The plan with the evaluated features, which a plan for coverage does not contain.
v1::Plan PlanOfFeatures(const v1::Plan& plan, const v1::InspectionResult& result) {
  const auto& planned = plan.uncertainty().features();
  bool same = planned.size() == result.features_size();
  for (int i = 0; same && i < planned.size(); ++i) {
    same = planned[i].name() == result.features(i).name();
  }
  if (same) return plan;
  v1::Plan changed = plan;
  changed.mutable_uncertainty()->clear_features();
  for (const v1::InspectedFeature& feature : result.features()) {
    v1::FeatureVerdict& verdict = *changed.mutable_uncertainty()->add_features();
    verdict.set_id(feature.id());
    verdict.set_name(feature.name());
    verdict.set_kind(feature.kind());
    verdict.set_text(feature.text());
    if (feature.has_zone_width_m()) verdict.set_zone_width_m(feature.zone_width_m());
    verdict.set_verdict(v1::FeatureVerdict::NOT_EVALUATED);
    verdict.set_because("not predicted by the plan");
    verdict.set_targets(feature.targets());
  }
  return changed;
}

SurfaceDeviations DeviationsToShow(const MeasuredSurface& surface,
                                   const Requirements& requirements) {
  SurfaceDeviations shown;
  shown.targets = &surface.targets;
  for (const DeviationEstimate& estimate : surface.estimates) {
    shown.deviations_m.push_back(static_cast<float>(estimate.mean_m));
    shown.measured.push_back(estimate.points > 0);
  }
  // The scale ends at the widest profile zone, so that deviations beyond every zone have full
  // colour.
  double widest_m = 0;
  for (const TolerancedFeature& feature : requirements.features) {
    widest_m = std::max(widest_m, feature.zone_width_m);
  }
  shown.scale_m = widest_m > 0 ? 0.5 * widest_m : 1e-4;
  return shown;
}

absl::Status WriteOutliers(const MeasuredPart& part, const fs::path& out) {
  if (part.outliers_m.empty()) return RemoveFiles(out.string(), {"outliers.ply"});
  const std::vector<Eigen::Vector3f> normals(part.outliers_m.size(), Eigen::Vector3f::Zero());
  return WritePlyPoints((out / "outliers.ply").string(), part.outliers_m, normals);
}

// The plan with the next scan appended. The other scans keep their order, since files of points are
// named by scan number. It has no poses or predictions; `sightline evaluate` adds them.
v1::Plan PlanWithNextScan(const InspectedPart& asked, const v1::NextScan& next) {
  v1::Plan plan;
  plan.set_inspection_name(asked.inspection.name);
  plan.set_sightline_version(SIGHTLINE_VERSION);
  plan.set_strategy(asked.plan.strategy());
  plan.set_part_digest(asked.digest.Text());
  for (const v1::PlannedScan& earlier : asked.plan.scans()) {
    v1::PlannedScan& scan = *plan.add_scans();
    scan.set_index(plan.scans_size());
    *scan.mutable_measurement() = earlier.measurement();
    if (earlier.has_setting()) *scan.mutable_setting() = earlier.setting();
    scan.set_locked(true);
  }
  v1::PlannedScan& scan = *plan.add_scans();
  scan.set_index(plan.scans_size());
  *scan.mutable_measurement() = next.measurement();
  return plan;
}

absl::Status WriteNextPlan(const InspectedPart& asked, const v1::InspectionResult& result,
                           const fs::path& out) {
  if (!result.has_next_scan()) return RemoveFiles(out.string(), {"next_plan.json"});
  return WriteFileAtomically((out / "next_plan.json").string(),
                             ToJson(PlanWithNextScan(asked, result.next_scan())) + "\n");
}

absl::Status WriteInspection(const InspectOptions& options, const InspectedPart& asked,
                             const MeasuredPart& part, const MeasuredSurface& surface,
                             const v1::InspectionResult& result) {
  const fs::path out = options.out;
  const auto write = [&](const char* name, const std::string& text) {
    return WriteFileAtomically((out / name).string(), text);
  };
  SIGHTLINE_RETURN_IF_ERROR(write("measured.json", ToJson(result) + "\n"));
  SIGHTLINE_RETURN_IF_ERROR(write("measured.csv", MeasuredCsv(result)));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto qif,
                             QifDocument(PlanOfFeatures(asked.plan, result),
                                         fs::path(asked.inspection.part_file).filename().string(),
                                         asked.requirements.tolerances, &result));
  SIGHTLINE_RETURN_IF_ERROR(write("results.qif", qif));
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto report, InspectionReport(result, DeviationsToShow(surface, asked.requirements)));
  SIGHTLINE_RETURN_IF_ERROR(WriteReport(report, (out / "report.html").string()));
  SIGHTLINE_RETURN_IF_ERROR(WriteNextPlan(asked, result, out));
  return WriteOutliers(part, out);
}

std::string TerminalLine(const v1::InspectedFeature& feature) {
  std::string line =
      absl::StrFormat("%-16s %s (%s)", v1::InspectedFeature::Decision_Name(feature.decision()),
                      feature.name(), feature.kind());
  if (feature.has_value_m()) {
    absl::StrAppendFormat(&line, ": %.4f mm, U = %.4f mm", 1e3 * feature.value_m(),
                          1e3 * feature.expanded_uncertainty_m());
    if (feature.has_lower_limit_m()) {
      absl::StrAppendFormat(&line, ", limits %.4f to %.4f mm", 1e3 * feature.lower_limit_m(),
                            1e3 * feature.upper_limit_m());
    } else if (feature.has_zone_width_m()) {
      absl::StrAppendFormat(&line, ", zone %.4f mm", 1e3 * feature.zone_width_m());
    }
  }
  return absl::StrCat(line, "; ", feature.because());
}

void PrintInspection(const InspectOptions& options, const v1::InspectionResult& result) {
  for (const v1::InspectedFeature& feature : result.features()) {
    PrintText("%s\n", TerminalLine(feature));
  }
  for (const std::string& warning : result.warnings()) PrintText("warning: %s\n", warning);
  if (result.has_next_scan()) {
    const v1::NextScan& next = result.next_scan();
    PrintText(
        "next scan: decides %d of %d open targets: camera %.1f mm, triangulation %.1f deg, azimuth "
        "%.1f deg, polar %.1f deg, part %.1f, %.1f, %.1f deg\n",
        next.settled_targets(), next.open_targets(), 1e3 * next.measurement().camera_distance_m(),
        next.measurement().triangulation_angle_deg(), next.measurement().camera_azimuth_deg(),
        next.measurement().camera_polar_deg(), next.measurement().part_alpha_deg(),
        next.measurement().part_beta_deg(), next.measurement().part_gamma_deg());
  }
  if (result.has_next_scan()) {
    PrintText("next plan: %s, for `sightline evaluate`\n",
              fs::absolute(fs::path(options.out) / "next_plan.json").string());
  }
  PrintText("measured: %s\nreport:   %s\n",
            fs::absolute(fs::path(options.out) / "measured.json").string(),
            fs::absolute(fs::path(options.out) / "report.html").string());
}

bool Has(const v1::InspectionResult& result, v1::InspectedFeature::Decision decision) {
  return std::any_of(result.features().begin(), result.features().end(),
                     [&](const auto& feature) { return feature.decision() == decision; });
}

int ExitCodeOf(const InspectOptions& options, const v1::InspectionResult& result) {
  if (options.fail_on.empty()) return kExitDone;
  if (Has(result, v1::InspectedFeature::DOES_NOT_CONFORM)) return kExitFailed;
  const bool open = options.fail_on == "undecided" && Has(result, v1::InspectedFeature::UNDECIDED);
  return open ? kExitFailed : kExitDone;
}

absl::StatusOr<int> Inspect(InspectOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto asked, ReadInspectedPart(options));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto finding, PartOptionsOf(options.measured));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  SIGHTLINE_ASSIGN_OR_RETURN(auto found,
                             FindMeasuredPart(*asked.mesh, asked.inspection, asked.earlier.files,
                                              asked.earlier.scans, finding));
  const auto part = std::make_shared<const MeasuredPart>(std::move(found));
  PrintPointCounts(*part);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto surface,
                             EstimateSurface(*asked.mesh, asked.inspection, *part));
  JudgedInspection judged =
      JudgeMeasured(asked.inspection, asked.requirements, *part, asked.earlier.scans, surface);
  v1::InspectionResult& result = judged.result;
  result.set_sightline_version(SIGHTLINE_VERSION);
  result.set_inspection_name(asked.inspection.name);
  result.set_part_digest(asked.digest.Text());
  for (const std::string& warning : asked.warnings) result.add_warnings(warning);
  WarnOfMissingScans(asked.earlier, result);
  if (options.next_scan && Has(result, v1::InspectedFeature::UNDECIDED)) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto next, FindNextScan(options.next, asked.earlier, part, judged));
    if (next) {
      *result.mutable_next_scan() = *next;
    } else {
      result.add_warnings("No further scan of this rig adds to what is undecided.");
    }
  }
  SIGHTLINE_RETURN_IF_ERROR(WriteInspection(options, asked, *part, surface, result));
  PrintInspection(options, result);
  return InterruptFlag() ? kExitInterrupted : ExitCodeOf(options, result);
}

}  // namespace

Command AddInspectCommand(CLI::App& app) {
  auto options = std::make_shared<InspectOptions>();
  app.add_option("inspection", options->inspection_file, "inspection.json with tolerances")
      ->required();
  app.add_option("--plan", options->plan_file, "plan.json whose scans were carried out")
      ->required();
  app.add_option("--measured", options->measured.files,
                 "points that the scans have measured (PLY, PCD, CSV of profiles, depth rasters), "
                 "one file per scan: scan_NN.ply, or in the order of the scans")
      ->required();
  app.add_option("--out", options->out,
                 "folder for measured.json, report.html, results.qif, next_plan.json, ...")
      ->required();
  AddRegistrationOptions(app, &options->measured);
  AddOtherPartOption(app, &options->plans.other_part);
  app.add_option("--fail-on", options->fail_on,
                 "exit code 1 if a feature does not conform; with undecided also if one is "
                 "undecided")
      ->check(CLI::IsMember({"does-not-conform", "undecided"}));
  app.add_flag("!--no-next-scan", options->next_scan,
               "do not look for the scan that would decide what is undecided");
  app.add_option("--seed", options->next.seed, "of the search for the next scan");
  app.add_option("--evaluations-per-scan", options->next.evaluations,
                 "gain evaluations of that search")
      ->check(CLI::Range(1, 100000000));
  app.add_option("--coverage-server", options->next.coverage_server,
                 "unix:PATH or HOST:PORT; default: an embedded server");
  AddServerTlsOptions(app, &options->next.tls);
  return [options]() -> int {
    options->next.inspection_file = options->inspection_file;
    const absl::StatusOr<int> code = Inspect(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
