// SPDX-License-Identifier: Apache-2.0
#include "report/plan/surface/uncovered_reasons.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "report/page/number_text.h"

namespace sightline {

std::vector<v1::UncoveredCount> CountReasons(std::span<const TargetReason> reasons,
                                             const TargetBits& measurable,
                                             std::span<const std::string> obstacle_names,
                                             std::span<const uint32_t> targets) {
  // By: not measurable, reason, obstacle.
  struct Count {
    int64_t targets = 0;
    std::vector<double> exposure_times_s;  // of reasons of light
  };
  std::map<std::tuple<bool, int, int>, Count> counts;
  for (const uint32_t target : targets) {
    const TargetReason& reason = reasons[target];
    if (reason.reason == v1::UNCOVERED_REASON_UNSPECIFIED) continue;
    Count& count = counts[{!measurable.Test(target), reason.reason, reason.obstacle}];
    ++count.targets;
    if (reason.exposure_time_s > 0) count.exposure_times_s.push_back(reason.exposure_time_s);
  }
  std::vector<v1::UncoveredCount> result;
  for (auto& [key, count] : counts) {
    const auto& [not_measurable, reason, obstacle] = key;
    v1::UncoveredCount& message = result.emplace_back();
    message.set_reason(static_cast<v1::UncoveredReason>(reason));
    if (obstacle >= 0 && static_cast<size_t>(obstacle) < obstacle_names.size()) {
      message.set_obstacle(obstacle_names[obstacle]);
    }
    message.set_targets(count.targets);
    message.set_measurable(!not_measurable);
    if (std::vector<double>& times_s = count.exposure_times_s; !times_s.empty()) {
      const auto middle = times_s.begin() + static_cast<std::ptrdiff_t>(times_s.size() / 2);
      std::nth_element(times_s.begin(), middle, times_s.end());
      if (std::isfinite(*middle)) message.set_exposure_time_s(*middle);
    }
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
      // The exposure time of the larger group, or of the other one if that has none.
      if (count.has_exposure_time_s() &&
          (!same->has_exposure_time_s() || count.targets() > same->targets())) {
        same->set_exposure_time_s(count.exposure_time_s());
      }
      same->set_targets(same->targets() + count.targets());
    } else {
      joined.push_back(count);
    }
  }
  std::stable_sort(joined.begin(), joined.end(),
                   [](const auto& a, const auto& b) { return a.targets() > b.targets(); });
  return joined;
}

namespace {

std::string TimeText(double time_s) { return QuantityText("exposure_time_s", time_s, 2); }

std::string LightWords(const v1::UncoveredCount& count, bool dark,
                       const std::optional<ExposureLimits>& permitted) {
  std::string words = dark ? "too dark" : "too bright";
  if (!count.has_exposure_time_s()) {
    return absl::StrCat(words, ": no exposure shows the laser line on the material");
  }
  absl::StrAppend(&words, dark ? ": needs " : ": at most ", TimeText(count.exposure_time_s()));
  if (permitted) {
    absl::StrAppend(&words, dark ? ", the longest" : ", the shortest", " permitted exposure is ",
                    TimeText(dark ? permitted->longest_s : permitted->shortest_s));
  } else {
    absl::StrAppend(&words, dark ? ", longer than any" : ", shorter than any",
                    " permitted exposure");
  }
  return words;
}

}  // namespace

std::string ReasonWords(const v1::UncoveredCount& count,
                        const std::optional<ExposureLimits>& permitted) {
  const std::string& obstacle = count.obstacle();
  switch (count.reason()) {
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
    case v1::UNCOVERED_REASON_TOO_DARK:
    case v1::UNCOVERED_REASON_TOO_BRIGHT:
      return LightWords(count, count.reason() == v1::UNCOVERED_REASON_TOO_DARK, permitted);
    default:
      return "no reason known";
  }
}

std::string ReasonList(std::span<const v1::UncoveredCount> counts, size_t most,
                       const std::optional<ExposureLimits>& permitted) {
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
                           : ReasonWords(joined[i], permitted),
                    " (", joined[i].targets(), ")");
  }
  if (others > 0) absl::StrAppend(&words, ", others (", others, ")");
  return words;
}

}  // namespace sightline
