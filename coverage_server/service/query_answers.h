// SPDX-License-Identifier: Apache-2.0
// Functions that answers to queries have in common.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "coverage_server/scene/coverage_scene.h"
#include "sightline/v1/coverage_service.pb.h"

namespace sightline {

// Fast queries take tens of microseconds, so a chunk takes much longer than a thread's wake-up.
inline constexpr size_t kFastChunk = 16;
// Size of the chunks of a batch of fast queries: two per thread, because scans differ in duration.
inline size_t FastChunk(size_t queries, int threads) {
  const size_t shares = 2 * static_cast<size_t>(threads);
  return std::clamp<size_t>((queries + shares - 1) / shares, 1, kFastChunk);
}
// Exact queries take tens of milliseconds.
inline constexpr size_t kExactChunk = 1;

v1::Feasibility FeasibilityToProto(Feasibility feasibility);

// FAILED_PRECONDITION, reason SCAN_INFEASIBLE; `field` is the scan's path in the request.
absl::Status InfeasibleScan(const std::string& field, Feasibility feasibility);

}  // namespace sightline
