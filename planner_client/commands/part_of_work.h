// SPDX-License-Identifier: Apache-2.0
// --part K/N: commands that divide their work among processes or machines.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

struct PartOfWork {
  int number = 1;  // from 1 to `count`
  int count = 1;   // 1: all of the work

  bool IsWhole() const { return count == 1; }
};

// "2/8"; empty: all of the work. INVALID_ARGUMENT where it is no such text, or where `checkpoint`,
// the folder by which the run after all parts knows what they made, is empty.
absl::StatusOr<PartOfWork> ParsePartOfWork(const std::string& part, const std::string& checkpoint);

}  // namespace sightline
