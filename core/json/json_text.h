// SPDX-License-Identifier: Apache-2.0
// JSON files as text.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// Text of a JSON file of at most 64 MiB. NOT_FOUND if it cannot be read, INVALID_ARGUMENT if it is
// larger or no regular file. ParseStrictJson takes at most 2 million values of it, 64 levels deep.
absl::StatusOr<std::string> ReadJsonText(const std::string& path);

}  // namespace sightline
