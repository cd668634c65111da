// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/part_of_work.h"

#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/text/number.h"

namespace sightline {

absl::StatusOr<PartOfWork> ParsePartOfWork(const std::string& part, const std::string& checkpoint) {
  PartOfWork work;
  if (part.empty()) return work;
  const std::vector<std::string> numbers = absl::StrSplit(part, '/');
  const auto number = ParseWhole(numbers[0]), count = ParseWhole(numbers.back());
  constexpr int kMost = std::numeric_limits<int>::max();
  if (numbers.size() != 2 || !number.ok() || !count.ok() || *number < 1 || *count < *number ||
      *count > kMost) {
    return absl::InvalidArgumentError(
        absl::StrCat("--part ", part, ": must be K/N, number K of N parts, from 1/N to N/N"));
  }
  work.number = static_cast<int>(*number);
  work.count = static_cast<int>(*count);
  if (!checkpoint.empty()) return work;
  return absl::InvalidArgumentError(
      "--part needs --checkpoint: by it the run after all parts knows what they made");
}

}  // namespace sightline
