// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/execution_bound.h"

#include <algorithm>
#include <bit>
#include <map>
#include <vector>

#include "absl/strings/str_format.h"

namespace sightline {
namespace {

// Largest number of examined sets of faces; 20 faces have a million.
constexpr int64_t kMostFaceSets = int64_t{1} << 20;

// For every set of faces that occurs: the number of targets measurable from exactly these faces.
using FaceCounts = std::vector<std::pair<uint64_t, int64_t>>;

FaceCounts CountByFaces(std::span<const uint64_t> measurable_from, const TargetBits& wanted) {
  std::map<uint64_t, int64_t> counts;
  for (size_t t = 0; t < measurable_from.size(); ++t) {
    if (wanted.Test(t) && measurable_from[t] != 0) ++counts[measurable_from[t]];
  }
  return {counts.begin(), counts.end()};
}

int64_t CountFrom(const FaceCounts& counts, uint64_t faces) {
  int64_t sum = 0;
  for (const auto& [from, targets] : counts) {
    if ((from & faces) != 0) sum += targets;
  }
  return sum;
}

// True if `size` further faces, taken from index `next` on and added to `chosen`, reach the goal.
// `left` counts the sets that may still be examined; below 0 the answer is unknown.
bool AnySetReaches(const FaceCounts& counts, const std::vector<uint64_t>& faces, size_t next,
                   size_t size, uint64_t chosen, int64_t goal_targets, int64_t& left) {
  if (size == 0) return --left >= 0 && CountFrom(counts, chosen) >= goal_targets;
  for (size_t i = next; i + size <= faces.size() && left >= 0; ++i) {
    if (AnySetReaches(counts, faces, i + 1, size - 1, chosen | faces[i], goal_targets, left)) {
      return true;
    }
  }
  return false;
}

}  // namespace

FaceBound BoundFaces(std::span<const uint64_t> measurable_from, const TargetBits& wanted,
                     int64_t goal_targets) {
  FaceBound bound;
  bound.goal_targets = goal_targets;
  if (measurable_from.empty()) return bound;
  const FaceCounts counts = CountByFaces(measurable_from, wanted);
  uint64_t used = 0;
  for (const auto& [from, targets] : counts) used |= from;
  std::vector<uint64_t> faces;
  for (; used != 0; used &= used - 1) faces.push_back(used & (~used + 1));
  if (CountFrom(counts, ~uint64_t{0}) < goal_targets) {
    bound.exact = false;
    return bound;
  }
  int64_t left = kMostFaceSets;
  for (size_t size = 1; size <= faces.size(); ++size) {
    bound.faces = static_cast<int>(size);
    if (AnySetReaches(counts, faces, 0, size, 0, goal_targets, left)) return bound;
    if (left < 0) {
      // No smaller set reaches the goal; the sets of this size were not all examined.
      bound.exact = false;
      return bound;
    }
  }
  return bound;
}

ExecutionBounds BoundExecution(const ExecutionModel& model, const FaceBound& faces, int scans,
                               bool scans_converged) {
  ExecutionBounds bounds;
  // A robot that holds the part lays it by itself, which is no set-up.
  bounds.setups = model.robot_holds_part ? 1 : faces.faces;
  bounds.setups_converged = model.robot_holds_part || faces.exact;
  bounds.setups_statement = absl::StrFormat(
      "Any plan has at least %d set-ups: no scans were found that measure %d targets from fewer "
      "resting faces.%s",
      bounds.setups, faces.goal_targets,
      bounds.setups_converged ? "" : " Not all sets of faces were examined.");
  if (bounds.setups == 1) {
    bounds.setups_statement = "Any plan has at least one set-up.";
  }
  const CostModel& costs = model.costs;
  const double reposition_s = costs.reposition_time_s.value_or(0);
  // A robot that holds the sensor head changes the azimuth without any of these times.
  const double change_s =
      model.robot_holds_head
          ? 0
          : std::min({costs.lay_time_s, costs.turn_time_s, costs.move_sensors_time_s});
  const int changes = std::max(0, scans - bounds.setups);
  bounds.time_s = costs.move_sensors_time_s + bounds.setups * costs.lay_time_s +
                  changes * change_s + std::max(0, scans - 1) * reposition_s;
  bounds.time_converged = scans_converged && bounds.setups_converged;
  bounds.time_statement = absl::StrFormat(
      "Executing any plan that satisfies %d targets takes at least %.0f s: placing the sensors "
      "once (%.0f s), laying the part %d times (%.0f s each), and %d further changes of %.0f s at "
      "least. Scanning itself counts as 0.%s",
      faces.goal_targets, bounds.time_s, costs.move_sensors_time_s, bounds.setups, costs.lay_time_s,
      changes, change_s + reposition_s,
      bounds.time_converged ? "" : " The number of scans is no lower bound yet.");
  return bounds;
}

}  // namespace sightline
