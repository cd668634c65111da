// SPDX-License-Identifier: Apache-2.0
// Files with the results of single searches, for the process that chooses among several processes.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "planning/multi_start/start_result.h"

namespace sightline {

// Writes JSON that is exact to the last bit. `fingerprint` identifies everything besides the seed
// that the result depends on. The file appears complete or not at all.
absl::Status WriteStart(const StartResult& start, const std::string& fingerprint,
                        const std::string& path);

// Returns nothing if the file is missing, damaged, or of another fingerprint or seed; the search
// must then be repeated. `why` may be null; it gets the reason if the file exists.
std::optional<StartResult> ReadStart(const std::string& path, const std::string& fingerprint,
                                     int64_t seed, std::string* why = nullptr);

}  // namespace sightline
