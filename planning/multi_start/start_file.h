// SPDX-License-Identifier: Apache-2.0
// Results of searches in files, for the process that chooses among those of several processes.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "planning/multi_start/start_result.h"

namespace sightline {

// As JSON, exact to the last bit. `fingerprint` names everything that the result depends on beside
// the seed. The file appears complete or not at all.
absl::Status WriteStart(const StartResult& start, const std::string& fingerprint,
                        const std::string& path);

// Empty: there is no file, or it is of another fingerprint or seed, or is damaged; then the search
// is to be made again. `why`, which may be null, says which of these for a file that is there.
std::optional<StartResult> ReadStart(const std::string& path, const std::string& fingerprint,
                                     int64_t seed, std::string* why = nullptr);

}  // namespace sightline
