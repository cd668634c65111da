// SPDX-License-Identifier: Apache-2.0
// Numbers from text files of other programs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

// The numbers of a field of a YAML file whose keys stand on lines of their own; "pose.R" is the key
// R below pose. Brackets, commas and the dashes of lists only separate. INVALID_ARGUMENT names
// file, field and reason: no such key, no numbers, or something else than numbers.
absl::StatusOr<std::vector<double>> NumbersOfField(std::string_view text, const std::string& field,
                                                   const std::string& file);

// All numbers of a text in brackets, as Python writes tuples: ((1, 2, 3), (4, 5)).
absl::StatusOr<std::vector<double>> NumbersOfTuple(std::string_view text, const std::string& file);

}  // namespace sightline
