// SPDX-License-Identifier: Apache-2.0
// Reads secrets from files. Every user of the machine can read command lines.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// The file's content without the line break at its end: 1 byte to 4 KiB. INVALID_ARGUMENT names
// `option`, file and reason, never the content.
absl::StatusOr<std::string> ReadSecret(const std::string& option, const std::string& file);

}  // namespace sightline
