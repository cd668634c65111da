// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/part_of_work.h"

#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sightline {

absl::StatusOr<PartOfWork> ParsePartOfWork(const std::string& part, const std::string& checkpoint) {
  PartOfWork work;
  if (part.empty()) return work;
  const std::vector<std::string> numbers = absl::StrSplit(part, '/');
  if (numbers.size() != 2 || !absl::SimpleAtoi(numbers[0], &work.number) ||
      !absl::SimpleAtoi(numbers[1], &work.count) || work.number < 1 || work.count < work.number) {
    return absl::InvalidArgumentError(
        absl::StrCat("--part ", part, ": must be K/N, number K of N parts, from 1/N to N/N"));
  }
  if (!checkpoint.empty()) return work;
  return absl::InvalidArgumentError(
      "--part needs --checkpoint: by it the run after all parts knows what they made");
}

}  // namespace sightline
