// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/shard.h"

#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/text/number.h"

namespace sightline {

absl::StatusOr<Shard> ParseShard(const std::string& part, const std::string& checkpoint) {
  Shard work;
  if (part.empty()) return work;
  const std::vector<std::string> numbers = absl::StrSplit(part, '/');
  const auto number = ParseWhole(numbers[0]), count = ParseWhole(numbers.back());
  constexpr int kMost = std::numeric_limits<int>::max();
  if (numbers.size() != 2 || !number.ok() || !count.ok() || *number < 1 || *count < *number ||
      *count > kMost) {
    return absl::InvalidArgumentError(
        absl::StrCat("--part ", part, ": must be K/N, shard K of N, from 1/N to N/N"));
  }
  work.number = static_cast<int>(*number);
  work.count = static_cast<int>(*count);
  if (!checkpoint.empty()) return work;
  return absl::InvalidArgumentError(
      "--part needs --checkpoint: the final run finds the results of all shards there");
}

}  // namespace sightline
