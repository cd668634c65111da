// SPDX-License-Identifier: Apache-2.0
// Counts and texts of reasons why targets are not covered.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/targets/target_set.h"
#include "core/targets/uncovered_reason.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Counts the reasons of `targets`; covered ones (reason unspecified) are left out. Sorted by
// measurable targets first, then by frequency, then in the order of the enumeration.
std::vector<v1::UncoveredCount> CountReasons(std::span<const TargetReason> reasons,
                                             const TargetBits& measurable,
                                             std::span<const std::string> obstacle_names,
                                             std::span<const uint32_t> targets);

// The same counts, summed over measurable and other targets; most frequent first.
std::vector<v1::UncoveredCount> JoinMeasurable(std::span<const v1::UncoveredCount> counts);

// "hidden by the part itself", "hidden by clamp", "camera or laser would touch clamp", "too dark:
// needs 40 ms, the longest permitted exposure is 10 ms".
std::string ReasonWords(const v1::UncoveredCount& count,
                        const std::optional<ExposureLimits>& permitted = std::nullopt);

// "hidden by the part itself (120), not chosen (7)"; at most `most` reasons, then "others".
std::string ReasonList(std::span<const v1::UncoveredCount> counts, size_t most,
                       const std::optional<ExposureLimits>& permitted = std::nullopt);

}  // namespace sightline
