// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/effort_sections.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"

namespace sightline {

ReportBlocks CostBlocks(const v1::Plan& plan) {
  const v1::PlanCost& cost = plan.cost();
  double travel_m = 0;
  for (const v1::PlannedScan& scan : plan.scans()) {
    travel_m += scan.stage_end_m() - scan.stage_start_m();
  }
  std::vector<v1::ReportFact> facts = {
      CountFact("Scans", plan.scans_size()),
      NumberFact("Stage travel while scanning", 1e3 * travel_m, "mm",
                 absl::StrCat(Millimetres(travel_m, 0), " mm"))};
  ReportBlocks blocks;
  if (cost.unit_costs()) {
    blocks.push_back(
        RemarkBlock("The inspection states no speeds or times, so each scan costs 1."));
    facts.push_back(NumberFact("Cost", cost.total(), "", FixedNumber(cost.total(), 0)));
  } else {
    facts.push_back(SecondsFact("Scanning", cost.scan_time_s()));
    facts.push_back(SecondsFact("Repositioning", cost.reposition_time_s()));
    if (plan.robot_move_time_s() > 0) {
      facts.push_back(SecondsFact("Moves of the robot", plan.robot_move_time_s()));
    }
    facts.push_back(SecondsFact("Total", cost.total()));
  }
  blocks.push_back(FactsBlock(facts));
  return blocks;
}

ReportBlocks TimingBlocks(const ReportData& data) {
  std::vector<v1::ReportFact> facts;
  double total_s = 0;
  for (const NamedTiming& timing : data.timings) {
    facts.push_back(SecondsFact(timing.name, timing.seconds));
    total_s += timing.seconds;
  }
  if (facts.size() > 1) facts.push_back(SecondsFact("Total", total_s));
  facts.push_back(CountFact("Gain evaluations", data.plan.gain_evaluations()));
  return {FactsBlock(facts)};
}

ReportBlocks ComparisonBlocks(const ComparisonTable& table) {
  std::vector<v1::ReportColumn> columns = {WordsColumn("strategy"), NumberColumn("seeds")};
  for (const double goal : table.goals) columns.push_back(NumberColumn(GoalText(goal)));
  std::vector<ReportCells> rows;
  for (const StrategyComparison& strategy : table.strategies) {
    ReportCells row = {StrongCell(strategy.strategy), CountCell(strategy.seeds)};
    for (const StrategyComparison::Scans& scans : strategy.scans) {
      if (scans.seeds_reached == 0) {
        row.push_back(TextCell("not reached"));
        continue;
      }
      const std::string reached =
          scans.seeds_reached < strategy.seeds
              ? absl::StrCat(" (", scans.seeds_reached, " of ", strategy.seeds, " seeds)")
              : "";
      row.push_back(NumberCell(scans.median, absl::StrFormat("%g", scans.median), "",
                               absl::StrCat(scans.min, "\u2013", scans.max, reached)));
    }
    rows.push_back(std::move(row));
  }
  return {RemarkBlock("Scans needed at equal numbers of gain evaluations: median over the seeds, "
                      "with the range."),
          TableBlock("Scans that each strategy needs", columns, rows)};
}

}  // namespace sightline
