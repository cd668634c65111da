// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/command_options/option_values.h"
#include "core/json/strict_json.h"
#include "core/part/part_health.h"
#include "core/part/part_health_proto.h"
#include "core/tolerance/qif/qif_results.h"
#include "core/tolerance/tolerance_proto.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/part_files/part_file.h"
#include "planner_client/tolerance_import/tolerance_import.h"

namespace sightline {
namespace {

// "faces 12, 13", abbreviated "faces 12, 13, ... (30)"; or the names of features, if any.
std::string BoundText(const std::vector<int>& faces, const std::vector<std::string>& features) {
  constexpr size_t kMost = 8;
  if (faces.empty() && features.empty()) return "no face";
  if (!features.empty()) {
    const size_t shown = std::min(features.size(), kMost);
    const std::string more =
        features.size() > shown ? absl::StrCat(", ... (", features.size(), ")") : "";
    return absl::StrJoin(features.begin(), features.begin() + static_cast<int64_t>(shown), ", ") +
           more;
  }
  const size_t shown = std::min(faces.size(), kMost);
  const std::string more = faces.size() > shown ? absl::StrCat(", ... (", faces.size(), ")") : "";
  return absl::StrCat(
      faces.size() == 1 ? "face " : "faces ",
      absl::StrJoin(faces.begin(), faces.begin() + static_cast<int64_t>(shown), ", "), more);
}

void PrintTolerances(const ToleranceReport& report) {
  PrintText("%s (%s): ", report.file.c_str(), report.standard.c_str());
  if (report.entity_count == 0) {
    PrintText("no tolerances in the file\n");
  } else {
    PrintText(
        "%d dimensions, tolerances and datums in the file: %zu with a zone, %zu dimensions without "
        "limits, %zu datums, %zu not read\n",
        report.entity_count, report.read.size(), report.untoleranced.size(), report.datums.size(),
        report.not_read.size());
  }
  const auto heading = [](size_t count, const char* text) {
    if (count > 0) PrintText("\n%s\n", text);
  };
  const auto print = [](const std::vector<Tolerance>& list) {
    for (const Tolerance& tolerance : list) {
      PrintText("  %-50s  %s %s: %s\n", tolerance.text.c_str(), tolerance.name.c_str(),
                tolerance.id.c_str(), BoundText(tolerance.faces, tolerance.features).c_str());
    }
  };
  heading(report.read.size(), "read, with the faces bound:");
  print(report.read);
  heading(report.untoleranced.size(), "dimensions without limits of their own:");
  print(report.untoleranced);
  heading(report.datums.size(), "datums:");
  for (const Datum& datum : report.datums) {
    PrintText("  %-50s  %s: %s\n",
              absl::StrCat(datum.target ? "datum target " : "datum ", datum.letter).c_str(),
              datum.id.c_str(), BoundText(datum.faces, datum.features).c_str());
  }
  heading(report.not_read.size(), "not read:");
  for (const UnreadTolerance& unread : report.not_read) {
    PrintText("  %s: %s\n", unread.name.c_str(), unread.reason.c_str());
  }
  heading(report.notes.size(), "notes:");
  for (const std::string& note : report.notes) PrintText("  %s\n", note.c_str());
}

// "0.012 mm, u 0.002 mm, PASS"
std::string ValueText(const MeasuredCharacteristic& measured) {
  constexpr double kDegreesOfRadian = 180 / std::numbers::pi;
  const auto text = [](const std::optional<double>& length_m, const std::optional<double>& angle) {
    if (length_m) return absl::StrFormat("%.6g mm", 1e3 * *length_m);
    return angle ? absl::StrFormat("%.6g deg", kDegreesOfRadian * *angle) : std::string();
  };
  const std::string value = text(measured.value_m, measured.value_rad);
  const std::string uncertainty =
      text(measured.standard_uncertainty_m, measured.standard_uncertainty_rad);
  return absl::StrCat(value.empty() ? "no value" : value, uncertainty.empty() ? "" : ", u ",
                      uncertainty, measured.status.empty() ? "" : ", ", measured.status);
}

// The results of a measuring program for the characteristics of the report, by their persistent
// ids.
void PrintResults(const ToleranceReport& report, const QifMeasurementResults& results) {
  std::map<std::string, const Tolerance*> by_id;
  for (const Tolerance& tolerance : report.read) {
    if (!tolerance.persistent_id.empty()) by_id.emplace(tolerance.persistent_id, &tolerance);
  }
  PrintText("\nresults%s%s:\n", results.plan_persistent_id.empty() ? "" : " of the plan ",
            results.plan_persistent_id.c_str());
  std::set<std::string> measured_ids;
  for (const MeasuredCharacteristic& measured : results.characteristics) {
    const auto found = by_id.find(measured.persistent_id);
    if (found == by_id.end()) continue;
    measured_ids.insert(measured.persistent_id);
    PrintText("  %-50s  %s: %s\n", found->second->text.c_str(), found->second->name.c_str(),
              ValueText(measured).c_str());
  }
  for (const auto& [id, tolerance] : by_id) {
    if (!measured_ids.contains(id)) {
      PrintText("  %-50s  %s: not measured\n", tolerance->text.c_str(), tolerance->name.c_str());
    }
  }
  for (const MeasuredCharacteristic& measured : results.characteristics) {
    if (by_id.contains(measured.persistent_id)) continue;
    PrintText("  %s (item %s): %s; %s\n", measured.name.c_str(), measured.item_id.c_str(),
              ValueText(measured).c_str(),
              measured.persistent_id.empty() ? "has no persistent id"
                                             : "is none of these characteristics");
  }
}

int ReportTolerances(const std::string& file, const std::string& unit,
                     const std::string& qif_schema, bool json, const std::string& results_file) {
  if (json && !results_file.empty()) {
    return ReportError(absl::InvalidArgumentError("--json and --results exclude each other"));
  }
  ToleranceImportOptions options;
  options.length_unit = unit;
  options.qif_schema_folder = qif_schema;
  const auto imported = ImportTolerances(file, options);
  if (!imported.ok()) return ReportError(imported.status());
  if (json) {
    // The triangles of the faces are not readable output.
    std::printf("%s\n", ToJson(ToleranceReportToProto(imported->report, {})).c_str());
  } else {
    PrintTolerances(imported->report);
  }
  if (results_file.empty()) return kExitDone;
  const auto results = ReadQifResults(results_file, qif_schema);
  if (!results.ok()) return ReportError(results.status());
  for (const QifMeasurementResults& set : *results) PrintResults(imported->report, set);
  return kExitDone;
}

}  // namespace

Command AddPartCommand(CLI::App& app) {
  struct Options {
    std::string file, unit, qif_schema, results;
    bool construction_geometry = false, tolerances = false, json = false;
  };
  auto options = std::make_shared<Options>();
  app.add_option(
         "file", options->file,
         absl::StrCat("part file (", PartFileEndings(), "); for --tolerances .step, .stp, .qif"))
      ->required();
  app.add_option("--unit", options->unit,
                 "length unit of a file that states none, as STL: m, cm, mm, um, inch")
      ->transform(NameOfLengthUnit());
  app.add_flag("--construction-geometry", options->construction_geometry,
               "of a STEP file, take construction geometry for the part; it is left out and named "
               "otherwise");
  CLI::Option* tolerances = app.add_flag(
      "--tolerances", options->tolerances,
      "list the tolerances of a STEP (AP242) or QIF 3.0 file, and what of them cannot be read");
  app.add_option("--qif-schema", options->qif_schema,
                 "folder of the QIF 3.0 schema to validate a QIF file against")
      ->needs(tolerances);
  app.add_flag("--json", options->json, "print the report as JSON");
  app.add_option("--results", options->results,
                 "QIF 3.0 file with results for these tolerances, such as a measuring program "
                 "writes for plan.qif: print the value of each, by persistent ids")
      ->needs(tolerances);
  return [options]() -> int {
    if (options->tolerances) {
      return ReportTolerances(options->file, options->unit, options->qif_schema, options->json,
                              options->results);
    }
    PartFileOptions part_options;
    part_options.construction_geometry = options->construction_geometry;
    const auto mesh = LoadPartFile(options->file, options->unit, part_options);
    if (!mesh.ok()) return ReportError(mesh.status());
    const PartHealth health = CheckPartHealth(*mesh);
    if (options->json) {
      std::printf("%s\n", ToJson(PartHealthToProto(health)).c_str());
      return kExitDone;
    }
    const Eigen::Vector3d size = 1e3 * health.bounding_box_m.sizes();
    PrintText("size              %.2f x %.2f x %.2f mm\n", size.x(), size.y(), size.z());
    const auto line = [](const char* name, int64_t value) {
      PrintText("%-18s%lld\n", name, static_cast<long long>(value));
    };
    line("triangles", health.triangle_count);
    line("vertices", health.vertex_count);
    PrintText("%-18s%.2f cm2\n", "area", 1e4 * health.area_m2);
    line("components", health.component_count);
    line("open edges", health.open_edge_count);
    line("non-manifold", health.non_manifold_edge_count);
    line("degenerate", health.degenerate_triangle_count);
    line("duplicate", health.duplicate_triangle_count);
    line("flipped", health.flipped_component_count);
    for (const std::string& finding : health.findings) PrintText("- %s\n", finding.c_str());
    if (health.findings.empty()) PrintText("- nothing that hinders planning\n");
    return kExitDone;
  };
}

}  // namespace sightline
