// SPDX-License-Identifier: Apache-2.0
// --part K/N: shard K of N of a command whose work is divided among processes or machines.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

struct Shard {
  int number = 1;  // from 1 to `count`
  int count = 1;   // 1: all of the work

  bool IsWhole() const { return count == 1; }
};

// "2/8"; empty: all of the work. INVALID_ARGUMENT: no such text, or no `checkpoint`, the folder
// from which the run after all shards reads their results.
absl::StatusOr<Shard> ParseShard(const std::string& part, const std::string& checkpoint);

}  // namespace sightline
