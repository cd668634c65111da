// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/document/uncovered_outputs.h"

#include <numeric>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "core/targets/target_regions.h"
#include "report/plan/surface/uncovered_reasons.h"

namespace sightline {

absl::Status ExplainUncovered(const PlanningSession& session, PlanDocument* document) {
  CoverageClient& client = *session.client;
  const TargetSet& targets = client.targets();
  TargetBits covered(targets.size());
  for (const ChosenScan& scan : document->scans) covered |= scan.exact.covered;
  std::vector<uint32_t> uncovered;
  for (size_t t = 0; t < targets.size(); ++t) {
    if (!covered.Test(t)) uncovered.push_back(static_cast<uint32_t>(t));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto explained, client.ExplainTargets(uncovered));
  document->reasons.assign(targets.size(), {});
  for (size_t i = 0; i < uncovered.size(); ++i) document->reasons[uncovered[i]] = explained[i];

  std::vector<std::string> names;
  for (const CoverageTask::Obstacle& obstacle : session.obstacles) names.push_back(obstacle.name);
  const auto count = [&](std::span<const uint32_t> asked, auto* out) {
    out->Clear();
    for (v1::UncoveredCount& reason :
         CountReasons(document->reasons, client.measurable(), names, asked)) {
      *out->Add() = std::move(reason);
    }
  };
  v1::PlanCoverage& coverage = *document->plan.mutable_coverage();
  count(uncovered, coverage.mutable_uncovered());
  coverage.clear_regions();
  for (const TargetRegion& region : session.inspection.targets.regions) {
    v1::RegionCoverage& message = *coverage.add_regions();
    message.set_name(region.name);
    std::vector<uint32_t> inside;
    int64_t measurable = 0, covered_inside = 0;
    for (size_t t = 0; t < targets.size(); ++t) {
      if (!LiesInRegion(targets, t, region)) continue;
      inside.push_back(static_cast<uint32_t>(t));
      measurable += client.measurable().Test(t);
      covered_inside += covered.Test(t);
    }
    message.set_targets(static_cast<int64_t>(inside.size()));
    message.set_measurable_targets(measurable);
    message.set_covered_targets(covered_inside);
    count(inside, message.mutable_uncovered());
  }
  return absl::OkStatus();
}

std::string SummariseUncovered(const v1::PlanCoverage& coverage) {
  if (coverage.uncovered().empty()) return "";
  const std::vector<v1::UncoveredCount> counts(coverage.uncovered().begin(),
                                               coverage.uncovered().end());
  int64_t total = 0;
  for (const v1::UncoveredCount& count : counts) total += count.targets();
  std::string text = absl::StrFormat("%d targets are not covered: %s.\n", total,
                                     ReasonList(counts, counts.size()));
  for (const v1::RegionCoverage& region : coverage.regions()) {
    if (region.covered_targets() == region.targets()) continue;
    const std::vector<v1::UncoveredCount> of_region(region.uncovered().begin(),
                                                    region.uncovered().end());
    absl::StrAppendFormat(&text, "in region \"%s\" %d of %d: %s.\n", region.name(),
                          region.targets() - region.covered_targets(), region.targets(),
                          ReasonList(of_region, of_region.size()));
  }
  return text;
}

}  // namespace sightline
