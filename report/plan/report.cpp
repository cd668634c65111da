// SPDX-License-Identifier: Apache-2.0
#include "report/plan/report.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "report/page/html.h"
#include "report/plan/plan_scene.h"
#include "report/plan/sections/as_measured_section.h"
#include "report/plan/sections/effort_sections.h"
#include "report/plan/sections/finding.h"
#include "report/plan/sections/pareto_section.h"
#include "report/plan/sections/plan_text.h"
#include "report/plan/sections/quality_section.h"
#include "report/plan/sections/reasons_section.h"
#include "report/plan/sections/report_data.h"
#include "report/plan/sections/robot_section.h"
#include "report/plan/sections/scans_section.h"
#include "report/plan/sections/setups_section.h"
#include "report/plan/sections/surface_sections.h"
#include "report/plan/surface/display_mesh.h"
#include "report/plan/surface/uncovered_regions.h"
#include "report/uncertainty/uncertainty_report.h"

namespace sightline {
namespace {

constexpr size_t kMaxDisplayTriangles = 300000;
constexpr size_t kMaxRegions = 20;

ReportBlocks AccuracyBlocks(const ReportData& data) {
  const v1::PlanCoverage& coverage = data.plan.coverage();
  const v1::PlanUncertainty& uncertainty = data.plan.uncertainty();
  const auto of_measurable = [&](const std::string& name, int64_t count) {
    const int64_t measurable = coverage.measurable_targets();
    return PercentFact(
        name, measurable > 0 ? static_cast<double>(count) / static_cast<double>(measurable) : 0, 2);
  };
  std::vector<v1::ReportFact> fresh;
  if (coverage.has_fresh_coverage()) {
    fresh.push_back(PercentFact("Measured, on validation targets", coverage.fresh_coverage(), 2));
    fresh.push_back(CountFact("Fresh measurable targets", coverage.fresh_measurable_targets()));
  }
  if (uncertainty.has_fresh_admissible_fraction()) {
    fresh.push_back(PercentFact("Admissible", uncertainty.admissible_fraction(), 2));
    fresh.push_back(PercentFact("Admissible, on validation targets",
                                uncertainty.fresh_admissible_fraction(), 2));
  }
  if (coverage.has_placement_p5()) {
    const v1::Placement& placement = data.plan.placement();
    fresh.push_back(PercentFact(
        "Measured in 95 of 100 executions", coverage.placement_p5(), 2,
        absl::StrFormat("or more; standard deviations of placing the part %.3g mm and %.3g\u00b0, "
                        "the sensors %.3g mm and %.3g\u00b0",
                        1e3 * placement.part_position_m(), placement.part_angle_deg(),
                        1e3 * placement.sensor_position_m(), placement.sensor_angle_deg())));
  }
  ReportBlocks blocks = {
      RemarkBlock(
          "Every number in this report comes from the exact, frame-by-frame evaluation. The "
          "search used a faster estimate; this is how far it was off for the scans of this "
          "plan."),
      FactsBlock({PercentFact("Fast estimate, mean error", coverage.fast_mean_absolute_error(), 2,
                              "of all targets"),
                  PercentFact("Fast estimate, largest error", coverage.fast_max_absolute_error(), 2,
                              "of all targets"),
                  of_measurable("Measured, exact", coverage.covered_targets()),
                  of_measurable("Measured, without the check of normals",
                                coverage.covered_targets_without_normal_gate())})};
  if (fresh.empty()) return blocks;
  blocks.push_back(RemarkBlock(
      "Scans are chosen to suit the plan's targets; validation targets, sampled anew, "
      "show how much of that holds for the surface between them. A plan is executed with "
      "part and sensors a little beside their places, which costs coverage."));
  blocks.push_back(FactsBlock(fresh));
  return blocks;
}

ReportBlocks NotesBlocks(const std::vector<std::string>& notes) {
  std::vector<std::vector<v1::ReportRun>> items;
  for (const std::string& note : notes) items.push_back({PlainRun(note)});
  if (items.empty()) return {};
  return {ListBlock(items)};
}

// "1 covered + 0.2 admissible": the weights of the gain of a target.
std::string GainText(const v1::GainWeights& weights) {
  std::string gain;
  for (const auto& [name, weight] :
       {std::pair{"covered", weights.coverage()}, std::pair{"admissible", weights.admissible()},
        std::pair{"relaxed", weights.relaxed()}, std::pair{"information", weights.information()},
        std::pair{"total uncertainty", weights.total_uncertainty()}}) {
    if (weight == 0) continue;
    absl::StrAppendFormat(&gain, "%s%.4g %s", gain.empty() ? "" : " + ", weight, name);
  }
  return gain;
}

ReportBlocks ProvenanceBlocks(const ReportData& data) {
  const v1::Plan& plan = data.plan;
  const auto fact = [](const std::string& name, const std::string& text) {
    return TextFact(name, text.empty() ? kNoValue : text);
  };
  const auto length = [](const std::string& name, double length_m, const std::string& detail) {
    return NumberFact(name, 1e3 * length_m, "mm", absl::StrCat(Millimetres(length_m), " mm"),
                      detail);
  };
  std::vector<v1::ReportFact> facts = {
      fact("Inspection", plan.inspection_name()),
      fact("Part", data.part_name),
      fact("Sightline", plan.sightline_version()),
      fact("Strategy", plan.strategy()),
      fact("Seed", absl::StrCat(plan.seed())),
      fact("Stopped because", StopWords(plan.stop_reason())),
      length("Target spacing", data.sampling.spacing_m, absl::StrCat("seed ", data.sampling.seed)),
      length("Coverage radius", data.sampling.coverage_radius_m, ""),
      fact("Part digest", plan.part_digest()),
      fact("Scene digest", plan.scene_digest())};
  const std::string gain = GainText(plan.uncertainty().gain());
  if (!gain.empty()) facts.push_back(fact("Gain of a target", gain));
  return {FactsBlock(facts)};
}

v1::ReportBlock SceneBlock(const ReportData& data, const DisplayMesh& display,
                           const std::vector<UncoveredRegion>& regions) {
  v1::ReportBlock block;
  *block.mutable_scene() = PlanScene(data, display, regions);
  block.mutable_scene()->set_picture_png(data.coverage_png);
  return block;
}

void AddNarrowSection(v1::Report* report, const std::string& id, const std::string& title,
                      const ReportBlocks& blocks) {
  AddSection(report, id, title, blocks);
  report->mutable_sections(report->sections_size() - 1)->set_narrow(true);
}

void AddUncertaintySections(const ReportData& data, v1::Report* report) {
  if (data.plan.has_uncertainty()) {
    const bool selectable =
        data.uncertainty.has_value() && !data.uncertainty->feature_targets.empty();
    AddSection(report, "uncertainty", "The surface becomes known scan by scan",
               UncertaintyCurveBlocks(data.plan));
    AddSection(report, "features", "Which tolerances can be proven",
               FeatureBlocks(data.plan, selectable));
  }
  if (data.uncertainty.has_value()) {
    AddSection(report, "inadmissible", "Why targets are not admissible",
               InadmissibleBlocks(*data.uncertainty, data.measurable));
  }
}

}  // namespace

absl::StatusOr<v1::Report> PlanReport(const ReportData& data) {
  SIGHTLINE_RETURN_IF_ERROR(CheckReportData(data));
  const v1::Plan& plan = data.plan;
  TargetBits uncovered = data.measurable, covered(data.targets.size());
  for (const ReportScan& scan : data.scans) covered |= scan.covered;
  uncovered.Subtract(covered);
  std::vector<UncoveredRegion> regions =
      FindUncoveredRegions(data.targets, data.sampling, uncovered);
  const size_t region_count = regions.size();
  if (regions.size() > kMaxRegions) regions.erase(regions.begin() + kMaxRegions, regions.end());
  const DisplayMesh display =
      MakeDisplayMesh(data.mesh, data.targets, data.sampling.spacing_m, kMaxDisplayTriangles);

  v1::Report report;
  const std::string name = plan.inspection_name().empty() ? data.part_name : plan.inspection_name();
  report.set_title(absl::StrCat(name, " \u2013 inspection plan"));
  report.set_kind("plan");
  report.set_subject("Sightline \u00b7 inspection plan");
  report.set_heading(name);
  for (const v1::ReportRun& run : PlanFinding(plan)) *report.add_finding() = run;
  for (const v1::ReportFact& fact : PlanFigures(data)) *report.add_figures() = fact;

  AddSection(&report, "view", "The part and its scans", {SceneBlock(data, display, regions)});
  AddUncertaintySections(data, &report);
  if (plan.has_as_measured()) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto blocks, AsMeasuredBlocks(plan.as_measured(), plan.scans_size(), plan.has_uncertainty(),
                                      data.deviations));
    AddSection(&report, "as-measured", "As measured", blocks);
  }
  if (data.pareto.has_value()) {
    AddSection(&report, "pareto", "Fewer scans or less time", ParetoBlocks(*data.pareto));
  }
  AddSection(&report, "curve", "Coverage grows scan by scan", CurveBlocks(plan));
  AddSection(&report, "setups", "How the part lies",
             SetupsBlocks(data.plan, data.face_pictures_png));
  AddSection(&report, "scans", "Scans", ScansBlocks(data));
  AddSection(&report, "quality", "How finely each scan measures", QualityBlocks(plan));
  if (data.robot) AddSection(&report, "robot", "Robot", RobotBlocks(plan, *data.robot));
  AddSection(&report, "uncovered", "What stays unmeasured",
             UncoveredBlocks(data, regions, region_count, uncovered.Count()));
  AddSection(&report, "reasons", "Why places are not measured", ReasonsBlocks(data));
  AddSection(&report, "measurability", "What can be measured at all", MeasurabilityBlocks(data));
  if (data.comparison.has_value()) {
    AddSection(&report, "comparison", "Strategies compared", ComparisonBlocks(*data.comparison));
  }
  AddNarrowSection(&report, "cost", "Cost of executing it", CostBlocks(plan));
  AddNarrowSection(&report, "timing", "Computing time", TimingBlocks(data));
  AddNarrowSection(&report, "accuracy", "How sure the numbers are", AccuracyBlocks(data));
  AddNarrowSection(&report, "part", "Part", PartBlocks(data));
  std::vector<std::string> notes = data.notes;
  if (display.simplified) {
    notes.push_back(absl::StrCat("The interactive view shows a simplified mesh; planning used all ",
                                 GroupedInteger(static_cast<int64_t>(data.mesh.triangles.size())),
                                 " triangles."));
  }
  AddSection(&report, "notes", "Notes", NotesBlocks(notes));
  AddSection(&report, "provenance", "How to get this plan again", ProvenanceBlocks(data));
  return report;
}

}  // namespace sightline
