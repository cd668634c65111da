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

// Parses "2/8"; an empty text means all of the work. INVALID_ARGUMENT for another text, or without
// `checkpoint`, the folder from which the final run reads the results of all shards.
absl::StatusOr<Shard> ParseShard(const std::string& part, const std::string& checkpoint);

}  // namespace sightline
