// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/finding.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/report/charts/coverage_curve.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/plan/sections/plan_text.h"
#include "planner_client/report/plan/sections/report_data.h"
#include "planner_client/report/uncertainty/uncertainty_report.h"

namespace sightline {
namespace {

// The share of the surface that can be measured, and why not more.
std::string MeasurableShare(const v1::PlanCoverage& coverage) {
  if (coverage.targets() <= 0) return "";
  const auto share = [&](int64_t targets) {
    return Percent(static_cast<double>(targets) / static_cast<double>(coverage.targets()), 0);
  };
  const std::string with_rig = share(coverage.measurable_targets());
  const std::string anywhere = share(coverage.measurable_in_free_space_targets());
  std::string limits;
  if (coverage.measurable_in_free_space_targets() > coverage.measurable_targets()) {
    limits = with_rig == anywhere
                 ? " (nearly all that sensors anywhere would measure)"
                 : absl::StrCat(" (table, rests, domain and limits leave that of the ", anywhere,
                                " that sensors anywhere would measure)");
  }
  return absl::StrCat(" ", with_rig, " of the whole surface is measurable with this rig", limits,
                      ".");
}

std::string ScansFinding(const v1::Plan& plan) {
  const v1::PlanCoverage& coverage = plan.coverage();
  const int scans = plan.scans_size();
  if (plan.has_uncertainty()) {
    return absl::StrCat(UncertaintyFinding(plan, StopWords(plan.stop_reason())),
                        scans == 1 ? " It measures " : " The scans measure ",
                        Percent(coverage.coverage()), " of the measurable surface.",
                        MeasurableShare(coverage));
  }
  std::string html =
      absl::StrCat("<strong>", CountText(scans, "scan"), scans == 1 ? " measures " : " measure ",
                   Percent(coverage.coverage()), "</strong> of the measurable surface");
  if (coverage.goal() > 0 && !GoalReached(coverage)) {
    absl::StrAppend(&html, ", short of the goal of ", GoalText(coverage.goal()), ": ",
                    StopWords(plan.stop_reason()));
  }
  html += ".";
  if (coverage.has_fresh_coverage()) {
    absl::StrAppend(&html, " On ", GroupedInteger(coverage.fresh_measurable_targets()),
                    " targets that the search has not seen it is ",
                    Percent(coverage.fresh_coverage()), ".");
  }
  const v1::ScanCountBound& bound = plan.bound();
  if (bound.scans() > 0 && bound.converged()) {
    // Tolerance of the LP solver: 9.0000000001 still means 9.
    const int fewest = static_cast<int>(std::ceil(bound.scans() - 1e-6));
    absl::StrAppend(&html, " As far as the search for the lower bound (",
                    FixedNumber(bound.scans(), 1), ") found, a plan for ",
                    GoalText(coverage.goal()), " needs at least ", CountText(fewest, "scan"),
                    GoalReached(coverage) && scans <= fewest ? ": no fewer than this one." : ".");
  } else if (bound.scans() > 0) {
    absl::StrAppend(&html, " The relaxation stands at ", FixedNumber(bound.scans(), 1),
                    " scans; it is not proven to be a bound.");
  }
  return html + MeasurableShare(coverage);
}

}  // namespace

std::string FindingHtml(const v1::Plan& plan) {
  std::string remarks;
  for (const std::string& remark : plan.part_remarks()) {
    absl::StrAppend(&remarks, "<strong>", EscapeHtml(remark), ".</strong> ");
  }
  return remarks + ScansFinding(plan);
}

std::string FiguresHtml(const ReportData& data) {
  const v1::Plan& plan = data.plan;
  std::vector<std::pair<std::string, std::string>> figures;
  if (plan.has_uncertainty()) {
    figures = UncertaintyFigures(plan);
  } else {
    figures.push_back({"scans", absl::StrCat(plan.scans_size())});
  }
  // A plan for uncertainty has the goal of its own.
  const bool coverage_goal = plan.coverage().goal() > 0 && !plan.has_uncertainty();
  figures.push_back(
      {"measured",
       absl::StrCat(Percent(plan.coverage().coverage()),
                    coverage_goal ? absl::StrCat(" <small>goal ", GoalText(plan.coverage().goal()),
                                                 "</small>")
                                  : "")});
  if (plan.coverage().has_fresh_coverage()) {
    figures.push_back({"measured, validation targets", Percent(plan.coverage().fresh_coverage())});
  }
  if (plan.bound().scans() > 0 && !plan.has_uncertainty()) {
    figures.push_back(
        {plan.bound().converged() ? "lower bound" : "relaxation (not a bound)",
         absl::StrCat(FixedNumber(plan.bound().scans(), 1), " <small>scans</small>")});
  }
  figures.push_back(
      {"measurable targets",
       absl::StrCat(GroupedInteger(plan.coverage().measurable_targets()), " <small>of ",
                    GroupedInteger(plan.coverage().targets()), "</small>")});
  if (!plan.cost().unit_costs() && plan.cost().total() > 0) {
    figures.push_back({"time to execute",
                       SecondsText(plan.cost().scan_time_s() + plan.cost().reposition_time_s() +
                                   plan.robot_move_time_s())});
  }
  double planning_s = 0;
  for (const NamedTiming& timing : data.timings) planning_s += timing.seconds;
  if (planning_s > 0) figures.push_back({"computed in", SecondsText(planning_s)});
  std::string html;
  for (const auto& [name, value] : figures) {
    absl::StrAppend(&html, "<div><dt>", EscapeHtml(name), "</dt><dd>", value, "</dd></div>");
  }
  return html;
}

std::string CurveSection(const v1::Plan& plan) {
  CoverageCurve curve;
  const double measurable =
      std::max<double>(1, static_cast<double>(plan.coverage().measurable_targets()));
  for (const v1::PlannedScan& scan : plan.scans()) {
    curve.coverage.push_back(static_cast<double>(scan.cumulative_targets()) / measurable);
  }
  if (!plan.has_uncertainty()) {
    curve.goal = plan.coverage().goal();
    curve.bound_scans = plan.bound().scans();
    curve.bound_converged = plan.bound().converged();
  }
  if (plan.coverage().has_fresh_coverage()) curve.fresh = plan.coverage().fresh_coverage();
  std::string body = CoverageCurveSvg(curve);
  if (curve.fresh.has_value()) {
    body +=
        "<p class=\"soft key-line\">\u25c7 the same after the last scan, on targets that the "
        "search "
        "has not seen</p>\n";
  }
  if (!plan.bound().statement().empty() && !plan.has_uncertainty()) {
    absl::StrAppend(&body, "<p class=\"soft\">", EscapeHtml(plan.bound().statement()), "</p>\n");
  }
  return PlanSection("curve", "Coverage grows scan by scan", body);
}

}  // namespace sightline
