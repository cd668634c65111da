// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/plan_text.h"

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {

std::string Percent(double fraction, int decimals) {
  return absl::StrFormat("%.*f\u202f%%", decimals, 100 * fraction);
}

std::string GoalText(double fraction) { return absl::StrFormat("%.6g\u202f%%", 100 * fraction); }

std::string Millimetres(double length_m, int decimals) {
  return FixedNumber(1e3 * length_m, decimals);
}

std::string SecondsText(double seconds) {
  if (seconds >= 120) {
    const auto whole = static_cast<int64_t>(std::llround(seconds));
    return absl::StrFormat("%d min %02d s", whole / 60, whole % 60);
  }
  return absl::StrCat(FixedNumber(seconds, seconds < 10 ? 2 : 1), " s");
}

std::string CountText(int64_t count, absl::string_view noun) {
  return absl::StrCat(GroupedInteger(count), " ", noun, count == 1 ? "" : "s");
}

std::string PlanSection(absl::string_view id, absl::string_view title, absl::string_view body,
                        absl::string_view css_class) {
  return absl::StrCat("<section id=\"", id, "\" class=\"", css_class, "\">\n<h2>", title, "</h2>\n",
                      body, "</section>\n");
}

std::string FactsTable(const std::vector<std::pair<std::string, std::string>>& facts,
                       absl::string_view value_class) {
  std::string html = "<table class=\"facts\"><tbody>\n";
  for (const auto& [name, value] : facts) {
    absl::StrAppend(&html, "<tr><th scope=\"row\">", EscapeHtml(name), "</th><td class=\"",
                    value_class, "\">", value, "</td></tr>\n");
  }
  return html + "</tbody></table>\n";
}

std::string PictureFigure(const std::string& png, absl::string_view caption) {
  if (png.empty()) return "";
  return absl::StrCat("<figure><img alt=\"", EscapeHtml(caption), "\" src=\"", PngDataUri(png),
                      "\"><figcaption>", EscapeHtml(caption), "</figcaption></figure>\n");
}

std::string StopWords(v1::Plan::StopReason reason) {
  switch (reason) {
    case v1::Plan::STOP_REASON_GOAL_REACHED:
      return "the goal was reached";
    case v1::Plan::STOP_REASON_MAX_SCANS:
      return "the largest number of scans was reached";
    case v1::Plan::STOP_REASON_MAX_TIME:
      return "the time was up";
    case v1::Plan::STOP_REASON_STALLED:
      return "further scans would have added too little, although the rig can measure more";
    case v1::Plan::STOP_REASON_INTERRUPTED:
      return "it was interrupted";
    case v1::Plan::STOP_REASON_EVALUATED:
      return "the plan was given; only its coverage was computed";
    case v1::Plan::STOP_REASON_EXECUTION_LIMIT:
      return "a limit on time to execute, set-ups, sensor places or resting faces was reached";
    default:
      return "not recorded";
  }
}

bool GoalReached(const v1::PlanCoverage& coverage) {
  return coverage.goal() > 0 && coverage.coverage() >= coverage.goal() - 1e-12;
}

}  // namespace sightline
