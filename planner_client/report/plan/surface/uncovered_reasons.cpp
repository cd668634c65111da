// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/surface/uncovered_reasons.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "absl/strings/str_cat.h"

namespace sightline {

std::vector<v1::UncoveredCount> CountReasons(std::span<const TargetReason> reasons,
                                             const TargetBits& measurable,
                                             std::span<const std::string> obstacle_names,
                                             std::span<const uint32_t> targets) {
  // By: not measurable, reason, obstacle.
  std::map<std::tuple<bool, int, int>, int64_t> counts;
  for (const uint32_t target : targets) {
    const TargetReason& reason = reasons[target];
    if (reason.reason == v1::UNCOVERED_REASON_UNSPECIFIED) continue;
    ++counts[{!measurable.Test(target), reason.reason, reason.obstacle}];
  }
  std::vector<v1::UncoveredCount> result;
  for (const auto& [key, count] : counts) {
    const auto& [not_measurable, reason, obstacle] = key;
    v1::UncoveredCount& message = result.emplace_back();
    message.set_reason(static_cast<v1::UncoveredReason>(reason));
    if (obstacle >= 0 && static_cast<size_t>(obstacle) < obstacle_names.size()) {
      message.set_obstacle(obstacle_names[obstacle]);
    }
    message.set_targets(count);
    message.set_measurable(!not_measurable);
  }
  std::stable_sort(
      result.begin(), result.end(), [](const v1::UncoveredCount& a, const v1::UncoveredCount& b) {
        return std::pair(!a.measurable(), -a.targets()) < std::pair(!b.measurable(), -b.targets());
      });
  return result;
}

std::vector<v1::UncoveredCount> JoinMeasurable(std::span<const v1::UncoveredCount> counts) {
  std::vector<v1::UncoveredCount> joined;
  for (const v1::UncoveredCount& count : counts) {
    const auto same = std::find_if(joined.begin(), joined.end(), [&](const auto& other) {
      return other.reason() == count.reason() && other.obstacle() == count.obstacle();
    });
    if (same != joined.end()) {
      same->set_targets(same->targets() + count.targets());
    } else {
      joined.push_back(count);
    }
  }
  std::stable_sort(joined.begin(), joined.end(),
                   [](const auto& a, const auto& b) { return a.targets() > b.targets(); });
  return joined;
}

std::string ReasonWords(v1::UncoveredReason reason, const std::string& obstacle) {
  switch (reason) {
    case v1::UNCOVERED_REASON_NOT_CHOSEN:
      return "not chosen: other scans would measure it";
    case v1::UNCOVERED_REASON_OWN_OCCLUSION:
      return "hidden by the part itself";
    case v1::UNCOVERED_REASON_OBSTACLE:
      return absl::StrCat("hidden by ", obstacle.empty() ? "an obstacle" : obstacle);
    case v1::UNCOVERED_REASON_ANGLE:
      return "faces away from camera or laser";
    case v1::UNCOVERED_REASON_FOOTPRINT:
      return "pixels too coarse there";
    case v1::UNCOVERED_REASON_DEFOCUS:
      return "out of focus";
    case v1::UNCOVERED_REASON_RANGE:
      return "outside image, laser fan or range";
    case v1::UNCOVERED_REASON_COLLISION:
      return obstacle.empty() ? "camera or laser would collide"
                              : absl::StrCat("camera or laser would touch ", obstacle);
    case v1::UNCOVERED_REASON_TRAVEL:
      return "needs more stage travel than there is";
    default:
      return "no reason known";
  }
}

std::string ReasonList(std::span<const v1::UncoveredCount> counts, size_t most) {
  const std::vector<v1::UncoveredCount> joined = JoinMeasurable(counts);
  std::string words;
  int64_t others = 0;
  for (size_t i = 0; i < joined.size(); ++i) {
    if (i >= most) {
      others += joined[i].targets();
      continue;
    }
    const bool missed =
        !joined[i].measurable() && joined[i].reason() == v1::UNCOVERED_REASON_NOT_CHOSEN;
    absl::StrAppend(&words, words.empty() ? "" : ", ",
                    missed ? "some scan would measure it, which the search for measurable "
                             "targets missed"
                           : ReasonWords(joined[i].reason(), joined[i].obstacle()),
                    " (", joined[i].targets(), ")");
  }
  if (others > 0) absl::StrAppend(&words, ", others (", others, ")");
  return words;
}

}  // namespace sightline
