// What answers to queries have in common.
#pragma once

#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "coverage_server/scene/coverage_scene.h"
#include "sightline/v1/coverage_service.pb.h"

namespace sightline {

// Fast queries take tens of microseconds: a chunk is long against a thread's wake-up, and a batch
// of 64 still keeps four threads busy.
inline constexpr size_t kFastChunk = 16;
// Exact queries take tens of milliseconds.
inline constexpr size_t kExactChunk = 1;

v1::Feasibility FeasibilityToProto(Feasibility feasibility);

// FAILED_PRECONDITION, reason SCAN_INFEASIBLE; `field` is the scan's path in the request.
absl::Status InfeasibleScan(const std::string& field, Feasibility feasibility);

}  // namespace sightline
