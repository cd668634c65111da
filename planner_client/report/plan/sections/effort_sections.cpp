// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/effort_sections.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/plan/sections/plan_text.h"
#include "planner_client/report/plan/sections/report_data.h"

namespace sightline {

std::string CostSection(const v1::Plan& plan) {
  const v1::PlanCost& cost = plan.cost();
  double travel_m = 0;
  for (const v1::PlannedScan& scan : plan.scans())
    travel_m += scan.stage_end_m() - scan.stage_start_m();
  std::vector<std::pair<std::string, std::string>> facts = {
      {"Scans", absl::StrCat(plan.scans_size())},
      {"Stage travel while scanning", absl::StrCat(Millimetres(travel_m, 0), " mm")}};
  std::string body;
  if (cost.unit_costs()) {
    body =
        "<p class=\"soft\">The inspection states no speeds or times, so each scan costs 1.</p>\n";
    facts.push_back({"Cost", FixedNumber(cost.total(), 0)});
  } else {
    facts.push_back({"Scanning", SecondsText(cost.scan_time_s())});
    facts.push_back({"Repositioning", SecondsText(cost.reposition_time_s())});
    if (plan.robot_move_time_s() > 0) {
      facts.push_back({"Moves of the robot", SecondsText(plan.robot_move_time_s())});
    }
    facts.push_back({"Total", absl::StrCat("<strong>", SecondsText(cost.total()), "</strong>")});
  }
  return PlanSection("cost", "Cost of executing it", body + FactsTable(facts));
}

std::string TimingSection(const ReportData& data) {
  std::vector<std::pair<std::string, std::string>> facts;
  double total = 0;
  for (const NamedTiming& timing : data.timings) {
    facts.push_back({timing.name, SecondsText(timing.seconds)});
    total += timing.seconds;
  }
  if (facts.size() > 1)
    facts.push_back({"Total", absl::StrCat("<strong>", SecondsText(total), "</strong>")});
  facts.push_back({"Gain evaluations", GroupedInteger(data.plan.gain_evaluations())});
  return PlanSection("timing", "Computing time", FactsTable(facts));
}

std::string ComparisonSection(const ComparisonTable& table) {
  std::string body = absl::StrCat(
      "<p class=\"soft\">Scans needed at equal numbers of gain evaluations: median over the seeds, "
      "with the "
      "range.</p>\n",
      ScrollingTable("Scans that each strategy needs", "class=\"facts\""),
      "\n<thead><tr><th scope=\"col\">strategy</th><th scope=\"col\">seeds</th>");
  for (const double goal : table.goals)
    absl::StrAppend(&body, "<th scope=\"col\">", GoalText(goal), "</th>");
  body += "</tr></thead>\n<tbody>\n";
  for (const StrategyComparison& strategy : table.strategies) {
    absl::StrAppend(&body, "<tr><th scope=\"row\">", EscapeHtml(strategy.strategy), "</th><td>",
                    strategy.seeds, "</td>");
    for (const StrategyComparison::Scans& scans : strategy.scans) {
      if (scans.seeds_reached == 0) {
        body += "<td>not reached</td>";
        continue;
      }
      absl::StrAppend(&body, "<td><strong>", absl::StrFormat("%g", scans.median),
                      "</strong> <span class=\"soft\">", scans.min, "\u2013", scans.max, "</span>",
                      scans.seeds_reached < strategy.seeds
                          ? absl::StrCat(" <span class=\"soft\">(", scans.seeds_reached, " of ",
                                         strategy.seeds, ")</span>")
                          : "",
                      "</td>");
    }
    body += "</tr>\n";
  }
  return PlanSection("comparison", "Strategies compared", body + "</tbody></table></div>\n");
}

}  // namespace sightline
