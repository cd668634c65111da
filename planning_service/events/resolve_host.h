// SPDX-License-Identifier: Apache-2.0
// Name resolution that can be interrupted.
#pragma once

#include <atomic>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sightline {

// OK if `host` has an address. UNAVAILABLE names it; CANCELLED within 50 ms of `interrupted`.
absl::Status CheckHostResolves(const std::string& host, absl::Duration timeout,
                               const std::atomic<bool>& interrupted);

}  // namespace sightline
