// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/reasons_section.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "report/plan/sections/plan_text.h"
#include "report/plan/surface/uncovered_reasons.h"

namespace sightline {
namespace {

// Reasons named in one cell of a table.
constexpr size_t kNamedReasons = 3;

std::vector<std::string> ObstacleNames(const ReportData& data) {
  std::vector<std::string> names;
  for (const ReportObstacle& obstacle : data.obstacles) names.push_back(obstacle.name);
  return names;
}

v1::ReportCell Share(int64_t part, int64_t of) {
  return of > 0 ? PercentCell(static_cast<double>(part) / static_cast<double>(of))
                : TextCell(kNoValue);
}

v1::ReportBlock ReasonTable(const v1::PlanCoverage& coverage,
                            const std::optional<ExposureLimits>& permitted) {
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
  std::vector<ReportCells> rows;
  int64_t sum = 0, sum_measurable = 0;
  for (const v1::UncoveredCount& reason : JoinMeasurable(counts)) {
    const int64_t measurable = targets_of(reason, true);
    sum += reason.targets();
    sum_measurable += measurable;
    v1::ReportCell name = TextCell(ReasonWords(reason, permitted));
    name.set_reason(reason.reason());
    rows.push_back({name, CountCell(reason.targets()), Share(reason.targets(), coverage.targets()),
                    CountCell(measurable), CountCell(targets_of(reason, false))});
  }
  rows.push_back({StrongCell("not measured, in all"), CountCell(sum),
                  Share(sum, coverage.targets()), CountCell(sum_measurable),
                  CountCell(sum - sum_measurable)});
  return TableBlock("Reasons for which targets are not measured",
                    {WordsColumn("reason"), NumberColumn("targets"), NumberColumn("of all"),
                     NumberColumn("counted as measurable"), NumberColumn("not measurable")},
                    rows);
}

struct NamedTargets {
  std::string name;
  int64_t targets = 0, measurable = 0, covered = 0;
  std::string reasons;
};

v1::ReportBlock NamedTable(const std::string& title, const std::vector<NamedTargets>& named) {
  std::vector<ReportCells> rows;
  for (const NamedTargets& row : named) {
    rows.push_back({TextCell(row.name), CountCell(row.targets), CountCell(row.measurable),
                    CountCell(row.covered), Share(row.covered, row.targets),
                    TextCell(row.reasons)});
  }
  return TableBlock(
      title,
      {WordsColumn(title), NumberColumn("targets"), NumberColumn("measurable"),
       NumberColumn("measured"), NumberColumn("of its targets"), WordsColumn("why not the others")},
      rows);
}

}  // namespace

std::string ReasonsOf(const ReportData& data, const std::vector<uint32_t>& targets) {
  if (data.reasons.empty()) return "";
  return ReasonList(CountReasons(data.reasons, data.measurable, ObstacleNames(data), targets),
                    kNamedReasons, data.permitted_exposures);
}

std::string ReasonsOfUnmeasurable(const ReportData& data) {
  std::vector<uint32_t> targets;
  for (size_t t = 0; t < data.targets.size(); ++t) {
    if (!data.measurable.Test(t)) targets.push_back(static_cast<uint32_t>(t));
  }
  return ReasonsOf(data, targets);
}

ReportBlocks ReasonsBlocks(const ReportData& data) {
  const v1::PlanCoverage& coverage = data.plan.coverage();
  if (data.reasons.empty() || coverage.uncovered().empty()) return {};
  ReportBlocks blocks = {
      RemarkBlock(
          "For every target that the plan does not measure, scans of the inspection's domain "
          "were aimed at it. The reason is the condition that those failed at which came "
          "nearest to measuring it; a target is not chosen if one of them measures it. The few "
          "that "
          "are not counted as measurable all the same were missed by the search for measurable "
          "targets. "
          "\u201cWhy it is not measured\u201d in the view above shows where."),
      ReasonTable(coverage, data.permitted_exposures)};
  std::vector<NamedTargets> regions;
  for (const v1::RegionCoverage& region : coverage.regions()) {
    const std::vector<v1::UncoveredCount> counts(region.uncovered().begin(),
                                                 region.uncovered().end());
    regions.push_back({region.name(), region.targets(), region.measurable_targets(),
                       region.covered_targets(),
                       ReasonList(counts, kNamedReasons, data.permitted_exposures)});
  }
  if (!regions.empty()) blocks.push_back(NamedTable("region of interest", regions));
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
    blocks.push_back(NamedTable("toleranced feature", features));
  }
  return blocks;
}

}  // namespace sightline
