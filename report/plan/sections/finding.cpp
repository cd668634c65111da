// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/finding.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/coverage/coverage_chart.h"
#include "report/page/html.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"
#include "report/plan/sections/report_data.h"
#include "report/uncertainty/uncertainty_report.h"

namespace sightline {
namespace {

// The measurable fraction of the surface, and why it is not larger.
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

std::string BoundSentence(const v1::Plan& plan) {
  const v1::PlanCoverage& coverage = plan.coverage();
  const v1::ScanCountBound& bound = plan.bound();
  if (bound.scans() <= 0) return "";
  if (!bound.converged()) {
    return absl::StrCat(" The relaxation stands at ", FixedNumber(bound.scans(), 1),
                        " scans; it is not proven to be a bound.");
  }
  // Tolerance of the LP solver: 9.0000000001 still means 9.
  const int fewest = static_cast<int>(std::ceil(bound.scans() - 1e-6));
  return absl::StrCat(
      " As far as the search for the lower bound (", FixedNumber(bound.scans(), 1),
      ") found, a plan for ",
      GoalReached(coverage) ? GoalText(coverage.goal()) : "as much of the surface",
      " needs at least ", CountText(fewest, "scan"),
      GoalReached(coverage) && plan.scans_size() <= fewest ? ": no fewer than this one." : ".");
}

std::vector<v1::ReportRun> CoverageFinding(const v1::Plan& plan) {
  const v1::PlanCoverage& coverage = plan.coverage();
  const int scans = plan.scans_size();
  std::string text = " of the measurable surface";
  if (coverage.goal() > 0 && !GoalReached(coverage)) {
    absl::StrAppend(&text, ", short of the goal of ", GoalText(coverage.goal()), ": ",
                    StopWords(plan.stop_reason()));
  }
  text += ".";
  if (coverage.has_fresh_coverage()) {
    absl::StrAppend(&text, " On ", GroupedInteger(coverage.fresh_measurable_targets()),
                    " targets that the search has not seen it is ",
                    Percent(coverage.fresh_coverage()), ".");
  }
  if (coverage.has_placement_p5()) {
    absl::StrAppend(&text,
                    " With part and sensors placed as exactly as stated, 95 of 100 "
                    "executions measure at least ",
                    Percent(coverage.placement_p5()), ".");
  }
  return {StrongRun(absl::StrCat(CountText(scans, "scan"), scans == 1 ? " measures " : " measure ",
                                 Percent(coverage.coverage()))),
          PlainRun(absl::StrCat(text, BoundSentence(plan), MeasurableShare(coverage)))};
}

}  // namespace

std::vector<v1::ReportRun> PlanFinding(const v1::Plan& plan) {
  std::vector<v1::ReportRun> runs;
  for (const std::string& remark : plan.part_remarks()) {
    runs.push_back(StrongRun(absl::StrCat(remark, ". ")));
  }
  const auto append = [&](const std::vector<v1::ReportRun>& more) {
    runs.insert(runs.end(), more.begin(), more.end());
  };
  if (!plan.has_uncertainty()) {
    append(CoverageFinding(plan));
    return runs;
  }
  append(UncertaintyFinding(plan, StopWords(plan.stop_reason())));
  append({PlainRun(absl::StrCat(plan.scans_size() == 1 ? " It measures " : " The scans measure ",
                                Percent(plan.coverage().coverage()), " of the measurable surface.",
                                MeasurableShare(plan.coverage())))});
  return runs;
}

std::vector<v1::ReportFact> PlanFigures(const ReportData& data) {
  const v1::Plan& plan = data.plan;
  std::vector<v1::ReportFact> figures;
  if (plan.has_uncertainty()) {
    figures = UncertaintyFigures(plan);
  } else {
    figures.push_back(CountFact("scans", plan.scans_size()));
  }
  // A plan for uncertainty has a goal of its own, so the goal of coverage is not shown.
  const bool coverage_goal = plan.coverage().goal() > 0 && !plan.has_uncertainty();
  figures.push_back(
      PercentFact("measured", plan.coverage().coverage(), 1,
                  coverage_goal ? absl::StrCat("goal ", GoalText(plan.coverage().goal())) : ""));
  if (plan.coverage().has_fresh_coverage()) {
    figures.push_back(
        PercentFact("measured, validation targets", plan.coverage().fresh_coverage()));
  }
  if (plan.bound().scans() > 0 && !plan.has_uncertainty()) {
    figures.push_back(
        NumberFact(plan.bound().converged() ? "lower bound" : "relaxation (not a bound)",
                   plan.bound().scans(), "", FixedNumber(plan.bound().scans(), 1), "scans"));
  }
  figures.push_back(CountFact("measurable targets", plan.coverage().measurable_targets(),
                              absl::StrCat("of ", GroupedInteger(plan.coverage().targets()))));
  if (!plan.cost().unit_costs() && plan.cost().total() > 0) {
    figures.push_back(SecondsFact(
        "time to execute",
        plan.cost().scan_time_s() + plan.cost().reposition_time_s() + plan.robot_move_time_s()));
  }
  double planning_s = 0;
  for (const NamedTiming& timing : data.timings) planning_s += timing.seconds;
  if (planning_s > 0) figures.push_back(SecondsFact("computed in", planning_s));
  return figures;
}

ReportBlocks CurveBlocks(const v1::Plan& plan) {
  CoverageCurve curve;
  curve.title = "Coverage after each scan";
  curve.axis = "measured, of the measurable surface";
  curve.coverage_name = "measured";
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
  ReportBlocks blocks = {ChartBlock(CoverageChart(curve))};
  if (plan.has_uncertainty()) return blocks;
  for (const std::string* statement :
       {&plan.bound().statement(), &plan.bound().setups().statement(),
        &plan.bound().time_s().statement()}) {
    if (!statement->empty()) blocks.push_back(RemarkBlock(*statement));
  }
  return blocks;
}

}  // namespace sightline
