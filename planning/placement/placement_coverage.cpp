// SPDX-License-Identifier: Apache-2.0
#include "planning/placement/placement_coverage.h"

#include <algorithm>
#include <utility>

#include "core/random/random.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr uint64_t kSeed = 57;
constexpr double kQuantile = 0.05;

}  // namespace

int PlacementDrawsFor(size_t scans) {
  constexpr size_t kEvaluations = 360;
  return static_cast<int>(std::clamp<size_t>(kEvaluations / std::max<size_t>(1, scans), 12, 24));
}

std::vector<int64_t> CombineExecutions(const std::vector<std::vector<TargetBits>>& covered,
                                       std::span<const size_t> group_ends, int executions) {
  std::vector<int64_t> counts;
  if (covered.empty() || covered.front().empty()) return counts;
  // Targets that each group covers at each placement.
  std::vector<std::vector<TargetBits>> by_group;
  for (size_t g = 0; g < group_ends.size(); ++g) {
    std::vector<TargetBits>& draws = by_group.emplace_back();
    for (const std::vector<TargetBits>& scans : covered) {
      TargetBits& together = draws.emplace_back(scans.front().size());
      for (size_t s = g > 0 ? group_ends[g - 1] : 0; s < group_ends[g]; ++s) together |= scans[s];
    }
  }
  if (by_group.size() == 1) {
    for (const TargetBits& draw : by_group.front()) counts.push_back(draw.Count());
    return counts;
  }
  Random random(kSeed);
  for (int e = 0; e < executions; ++e) {
    TargetBits together(covered.front().front().size());
    for (const std::vector<TargetBits>& draws : by_group) {
      together |= draws[static_cast<size_t>(random.Below(static_cast<int64_t>(draws.size())))];
    }
    counts.push_back(together.Count());
  }
  return counts;
}

absl::StatusOr<double> PlacementCoverage(const PlacementModel& model,
                                         std::span<const Measurement> scans, int64_t measurable,
                                         const DisplacedEvaluation& evaluate) {
  if (scans.empty()) return 0.0;
  const PlacementDraws draws(model, scans);
  std::vector<Measurement> measurements;
  std::vector<ScanDisplacement> displacements;
  const int count = PlacementDrawsFor(scans.size());
  for (int d = 0; d < count; ++d) {
    measurements.insert(measurements.end(), scans.begin(), scans.end());
    const std::vector<ScanDisplacement> drawn = draws.Draw(kSeed, static_cast<uint32_t>(d));
    displacements.insert(displacements.end(), drawn.begin(), drawn.end());
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto answers, evaluate(measurements, displacements));
  std::vector<std::vector<TargetBits>> covered(static_cast<size_t>(count));
  for (size_t i = 0; i < answers.size(); ++i) {
    covered[i / scans.size()].push_back(std::move(answers[i].covered));
  }
  const int64_t at_quantile = LowerQuantile(
      CombineExecutions(covered, draws.group_ends(), kPlacementExecutions), kQuantile);
  return static_cast<double>(at_quantile) / static_cast<double>(measurable);
}

}  // namespace sightline
