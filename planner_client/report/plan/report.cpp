// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/report.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/assets.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/page_template.h"
#include "planner_client/report/plan/sections/as_measured_section.h"
#include "planner_client/report/plan/sections/effort_sections.h"
#include "planner_client/report/plan/sections/finding.h"
#include "planner_client/report/plan/sections/pareto_section.h"
#include "planner_client/report/plan/sections/plan_text.h"
#include "planner_client/report/plan/sections/quality_section.h"
#include "planner_client/report/plan/sections/reasons_section.h"
#include "planner_client/report/plan/sections/report_data.h"
#include "planner_client/report/plan/sections/robot_section.h"
#include "planner_client/report/plan/sections/scans_section.h"
#include "planner_client/report/plan/sections/setups_section.h"
#include "planner_client/report/plan/sections/surface_sections.h"
#include "planner_client/report/plan/surface/display_mesh.h"
#include "planner_client/report/plan/surface/uncovered_regions.h"
#include "planner_client/report/plan/viewer_data.h"
#include "planner_client/report/uncertainty/uncertainty_report.h"

namespace sightline {
namespace {

constexpr size_t kMaxDisplayTriangles = 300000;
constexpr size_t kMaxRegions = 20;

std::string SetupsSection(const ReportData& data) {
  std::vector<std::string> pictures;
  for (const ReportScan& scan : data.scans) pictures.push_back(scan.rendered_view_png);
  const std::string body = SetupsHtml(data.plan, pictures);
  return body.empty() ? "" : PlanSection("setups", "How the part lies", body, "long");
}

std::string AccuracySection(const ReportData& data) {
  const v1::PlanCoverage& coverage = data.plan.coverage();
  const auto of_measurable = [&](int64_t count) {
    return Percent(
        coverage.measurable_targets() > 0
            ? static_cast<double>(count) / static_cast<double>(coverage.measurable_targets())
            : 0,
        2);
  };
  std::string body =
      "<p class=\"soft\">Every number in this report comes from the exact, frame-by-frame "
      "evaluation. The "
      "search used a faster estimate; this is how far it was off for the scans of this plan.</p>\n";
  std::vector<std::pair<std::string, std::string>> fresh;
  if (coverage.has_fresh_coverage()) {
    fresh.push_back({"Measured, on validation targets", Percent(coverage.fresh_coverage(), 2)});
    fresh.push_back(
        {"Fresh measurable targets", GroupedInteger(coverage.fresh_measurable_targets())});
  }
  if (data.plan.uncertainty().has_fresh_admissible_fraction()) {
    fresh.push_back({"Admissible", Percent(data.plan.uncertainty().admissible_fraction(), 2)});
    fresh.push_back({"Admissible, on validation targets",
                     Percent(data.plan.uncertainty().fresh_admissible_fraction(), 2)});
  }
  if (!fresh.empty()) {
    body +=
        "<p class=\"soft\">Scans are chosen to suit the plan's targets; validation targets, "
        "sampled "
        "anew, "
        "show how much of that holds for the surface between them.</p>\n";
  }
  body += FactsTable(
      {{"Fast estimate, mean error",
        absl::StrCat(Percent(coverage.fast_mean_absolute_error(), 2), " of all targets")},
       {"Fast estimate, largest error",
        absl::StrCat(Percent(coverage.fast_max_absolute_error(), 2), " of all targets")},
       {"Measured, exact", of_measurable(coverage.covered_targets())},
       {"Measured, without the check of normals",
        of_measurable(coverage.covered_targets_without_normal_gate())}});
  if (!fresh.empty()) body += FactsTable(fresh);
  return PlanSection("accuracy", "How sure the numbers are", body);
}

std::string NotesSection(const std::vector<std::string>& notes) {
  std::string body = "<ul>";
  for (const std::string& note : notes) absl::StrAppend(&body, "<li>", EscapeHtml(note), "</li>");
  return PlanSection("notes", "Notes", body + "</ul>\n");
}

std::string ProvenanceSection(const ReportData& data) {
  const v1::Plan& plan = data.plan;
  const auto text = [](const std::string& value) {
    return value.empty() ? "\u2013" : EscapeHtml(value);
  };
  const auto code = [&](const std::string& value) {
    return absl::StrCat("<code>", text(value), "</code>");
  };
  std::string gain;
  for (const auto& [name, weight] :
       {std::pair{"covered", plan.uncertainty().gain().coverage()},
        std::pair{"admissible", plan.uncertainty().gain().admissible()},
        std::pair{"relaxed", plan.uncertainty().gain().relaxed()},
        std::pair{"information", plan.uncertainty().gain().information()},
        std::pair{"total uncertainty", plan.uncertainty().gain().total_uncertainty()}}) {
    if (weight != 0)
      absl::StrAppendFormat(&gain, "%s%.4g %s", gain.empty() ? "" : " + ", weight, name);
  }
  std::vector<std::pair<std::string, std::string>> facts = {
      {"Inspection", text(plan.inspection_name())},
      {"Part", text(data.part_name)},
      {"Sightline", text(plan.sightline_version())},
      {"Strategy", text(plan.strategy())},
      {"Seed", absl::StrCat(plan.seed())},
      {"Stopped because", StopWords(plan.stop_reason())},
      {"Target spacing",
       absl::StrCat(Millimetres(data.sampling.spacing_m), " mm, seed ", data.sampling.seed)},
      {"Coverage radius", absl::StrCat(Millimetres(data.sampling.coverage_radius_m), " mm")},
      {"Part digest", code(plan.part_digest())},
      {"Scene digest", code(plan.scene_digest())}};
  if (!gain.empty()) facts.push_back({"Gain of a target", gain});
  return PlanSection("provenance", "How to get this plan again", FactsTable(facts, "left"));
}

}  // namespace

absl::StatusOr<std::string> RenderReport(const ReportData& data) {
  if (absl::Status status = CheckReportData(data); !status.ok()) return status;

  TargetBits uncovered = data.measurable, covered(data.targets.size());
  for (const ReportScan& scan : data.scans) covered |= scan.covered;
  uncovered.Subtract(covered);
  const int64_t uncovered_count = uncovered.Count();
  std::vector<UncoveredRegion> regions =
      FindUncoveredRegions(data.targets, data.sampling, uncovered);
  const size_t region_count = regions.size();
  if (regions.size() > kMaxRegions) regions.erase(regions.begin() + kMaxRegions, regions.end());
  const DisplayMesh display =
      MakeDisplayMesh(data.mesh, data.targets, data.sampling.spacing_m, kMaxDisplayTriangles);

  std::string sections;
  if (data.plan.has_uncertainty()) {
    const bool selectable =
        data.uncertainty.has_value() && !data.uncertainty->feature_targets.empty();
    sections += UncertaintyCurveSection(data.plan) + FeatureSection(data.plan, selectable);
  }
  if (data.uncertainty.has_value())
    sections += InadmissibleSection(*data.uncertainty, data.measurable);
  if (data.plan.has_as_measured()) {
    sections += PlanSection("as-measured", "As measured",
                            AsMeasuredHtml(data.plan.as_measured(), data.plan.scans_size(),
                                           data.plan.has_uncertainty(), data.deviations));
  }
  if (data.pareto.has_value()) sections += ParetoSection(*data.pareto);
  sections += CurveSection(data.plan) + SetupsSection(data) + ScansSection(data) +
              QualitySection(data.plan) + (data.robot ? RobotSection(data.plan, *data.robot) : "") +
              UncoveredSection(data, regions, region_count, uncovered_count);
  if (const std::string reasons = ReasonsHtml(data); !reasons.empty()) {
    sections += PlanSection("reasons", "Why places are not measured", reasons);
  }
  sections += MeasurabilitySection(data);
  if (data.comparison.has_value()) sections += ComparisonSection(*data.comparison);
  absl::StrAppend(&sections, "<div class=\"columns\">", CostSection(data.plan), TimingSection(data),
                  AccuracySection(data), PartSection(data), "</div>\n");
  std::vector<std::string> notes = data.notes;
  if (display.simplified) {
    notes.push_back(absl::StrCat("The interactive view shows a simplified mesh; planning used all ",
                                 GroupedInteger(static_cast<int64_t>(data.mesh.triangles.size())),
                                 " triangles."));
  }
  if (!notes.empty()) sections += NotesSection(notes);
  sections += ProvenanceSection(data);

  const std::string name =
      data.plan.inspection_name().empty() ? data.part_name : data.plan.inspection_name();
  // Also what is printed in place of the interactive view.
  const std::string fallback =
      absl::StrCat("<div class=\"pictures\">",
                   PictureFigure(data.coverage_png, "Measured by the plan"), "</div>");
  return FillTemplate(
      ReportTemplate(),
      {{"TITLE", EscapeHtml(absl::StrCat(name, " \u2013 inspection plan"))},
       {"STYLE", absl::StrCat(ReportStyle(), data.pareto ? ChartStyle() : "")},
       {"HEADING", EscapeHtml(name)},
       {"FINDING", FindingHtml(data.plan)},
       {"FIGURES", FiguresHtml(data)},
       {"FALLBACK", fallback},
       {"SECTIONS", sections},
       {"FOOTER", absl::StrCat("Sightline ", EscapeHtml(data.plan.sightline_version()),
                               ". One file, nothing is loaded from anywhere.")},
       {"VIEWER_DATA", JsonForScript(ViewerDataJson(data, display, regions))},
       {"VIEWER_SCRIPT", std::string(ViewerScript())}});
}

}  // namespace sightline
