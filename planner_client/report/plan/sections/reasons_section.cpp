// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/reasons_section.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/plan/surface/uncovered_reasons.h"

namespace sightline {
namespace {

// Reasons named in one cell of a table.
constexpr size_t kNamedReasons = 3;

std::vector<std::string> ObstacleNames(const ReportData& data) {
  std::vector<std::string> names;
  for (const ReportObstacle& obstacle : data.obstacles) names.push_back(obstacle.name);
  return names;
}

std::string Share(int64_t part, int64_t of) {
  return of > 0 ? absl::StrFormat("%.1f\u202f%%",
                                  100 * static_cast<double>(part) / static_cast<double>(of))
                : "\u2013";
}

// Colour of a reason, as in the 3-D view.
std::string Key(v1::UncoveredReason reason) {
  return absl::StrCat("<span class=\"key\" style=\"background:var(--reason-",
                      static_cast<int>(reason), ")\"></span> ");
}

std::string ReasonTable(const v1::PlanCoverage& coverage) {
  const std::vector<v1::UncoveredCount> counts(coverage.uncovered().begin(),
                                               coverage.uncovered().end());
  const auto targets_of = [&](const v1::UncoveredCount& reason, bool measurable) {
    int64_t targets = 0;
    for (const v1::UncoveredCount& count : counts) {
      if (count.measurable() == measurable && count.reason() == reason.reason() &&
          count.obstacle() == reason.obstacle()) {
        targets += count.targets();
      }
    }
    return targets;
  };
  std::string html =
      absl::StrCat(ScrollingTable("Reasons for which targets are not measured",
                                  "class=\"facts\" id=\"reason-table\""),
                   "\n<thead><tr>"
                   "<th scope=\"col\" class=\"words\">reason</th><th scope=\"col\">targets</th><th "
                   "scope=\"col\">of all</th><th scope=\"col\">counted as "
                   "measurable</th><th scope=\"col\">not measurable</th></tr></thead>\n<tbody>\n");
  int64_t sum = 0, sum_measurable = 0;
  for (const v1::UncoveredCount& reason : JoinMeasurable(counts)) {
    const int64_t measurable = targets_of(reason, true);
    sum += reason.targets();
    sum_measurable += measurable;
    absl::StrAppend(&html, "<tr><td class=\"words\">", Key(reason.reason()),
                    EscapeHtml(ReasonWords(reason.reason(), reason.obstacle())), "</td><td>",
                    GroupedInteger(reason.targets()), "</td><td>",
                    Share(reason.targets(), coverage.targets()), "</td><td>",
                    GroupedInteger(measurable), "</td><td>",
                    GroupedInteger(targets_of(reason, false)), "</td></tr>\n");
  }
  absl::StrAppend(&html, "</tbody><tfoot><tr><td class=\"words\">not measured</td><td>",
                  GroupedInteger(sum), "</td><td>", Share(sum, coverage.targets()), "</td><td>",
                  GroupedInteger(sum_measurable), "</td><td>", GroupedInteger(sum - sum_measurable),
                  "</td></tr></tfoot></table></div>\n");
  return html;
}

struct NamedTargets {
  std::string name;
  int64_t targets = 0, measurable = 0, covered = 0;
  std::string reasons;  // HTML
};

std::string NamedTable(const std::string& title, const std::vector<NamedTargets>& rows) {
  std::string html = absl::StrCat(
      ScrollingTable(title, "class=\"facts\""), "\n<thead><tr><th scope=\"col\" class=\"words\">",
      title,
      "</th><th scope=\"col\">targets</th><th scope=\"col\">measurable</th><th "
      "scope=\"col\">measured</th><th scope=\"col\">of its targets</th>"
      "<th scope=\"col\" class=\"words\">why not the others</th></tr></thead>\n<tbody>\n");
  for (const NamedTargets& row : rows) {
    absl::StrAppend(&html, "<tr><td class=\"words\">", EscapeHtml(row.name), "</td><td>",
                    GroupedInteger(row.targets), "</td><td>", GroupedInteger(row.measurable),
                    "</td><td>", GroupedInteger(row.covered), "</td><td>",
                    Share(row.covered, row.targets), "</td><td class=\"words\">", row.reasons,
                    "</td></tr>\n");
  }
  return html + "</tbody></table></div>\n";
}

}  // namespace

std::string ReasonsOf(const ReportData& data, const std::vector<uint32_t>& targets) {
  if (data.reasons.empty()) return "";
  return EscapeHtml(ReasonList(
      CountReasons(data.reasons, data.measurable, ObstacleNames(data), targets), kNamedReasons));
}

std::string ReasonsOfUnmeasurable(const ReportData& data) {
  std::vector<uint32_t> targets;
  for (size_t t = 0; t < data.targets.size(); ++t) {
    if (!data.measurable.Test(t)) targets.push_back(static_cast<uint32_t>(t));
  }
  return ReasonsOf(data, targets);
}

std::string ReasonsHtml(const ReportData& data) {
  const v1::PlanCoverage& coverage = data.plan.coverage();
  if (data.reasons.empty() || coverage.uncovered().empty()) return "";
  std::string html =
      "<p class=\"soft\">For every target that the plan does not measure, scans of the "
      "inspection's domain were aimed at it. The reason is the condition that those failed at "
      "which "
      "came nearest to measuring it; a target is not chosen if one of them measures it. \u201cWhy "
      "it "
      "is not measured\u201d in the view above shows where.</p>\n";
  html += ReasonTable(coverage);
  std::vector<NamedTargets> regions;
  for (const v1::RegionCoverage& region : coverage.regions()) {
    const std::vector<v1::UncoveredCount> counts(region.uncovered().begin(),
                                                 region.uncovered().end());
    regions.push_back({region.name(), region.targets(), region.measurable_targets(),
                       region.covered_targets(), EscapeHtml(ReasonList(counts, kNamedReasons))});
  }
  if (!regions.empty()) html += NamedTable("region of interest", regions);
  if (data.uncertainty.has_value() && !data.uncertainty->feature_targets.empty()) {
    TargetBits covered(data.targets.size());
    for (const ReportScan& scan : data.scans) covered |= scan.covered;
    std::vector<NamedTargets> features;
    for (size_t f = 0; f < data.uncertainty->feature_targets.size(); ++f) {
      const std::vector<uint32_t>& targets = data.uncertainty->feature_targets[f];
      if (targets.empty()) continue;
      const v1::FeatureVerdict& verdict = data.plan.uncertainty().features(static_cast<int>(f));
      NamedTargets& row = features.emplace_back();
      row.name = verdict.name().empty() ? verdict.id() : verdict.name();
      row.targets = static_cast<int64_t>(targets.size());
      for (const uint32_t target : targets) {
        row.measurable += data.measurable.Test(target);
        row.covered += covered.Test(target);
      }
      row.reasons = ReasonsOf(data, targets);
    }
    html += NamedTable("toleranced feature", features);
  }
  return html;
}

}  // namespace sightline
