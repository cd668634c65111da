// SPDX-License-Identifier: Apache-2.0
// pareto.json: the front as a message, checked when it comes back, and the choice of a point.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/part_digest.h"
#include "planning/pareto/make_pareto_front.h"
#include "sightline/v1/pareto.pb.h"

namespace sightline {

// Inputs of a front.
struct ParetoTask {
  std::string inspection_name;
  std::string sightline_version;
  PartDigest part_digest;
  std::string part_file;  // for messages
  std::string scene_digest;
  CostModel costs;
  MeasurementDomain domain;
  bool for_uncertainty = false;
  double goal = 0;  // fraction of the toleranced targets
  int64_t judged_targets = 0;
  int64_t fresh_judged_targets = 0;  // 0: none were sampled
};

// `chosen`: index of a point of the front; `stop_reason`: that of the result.
v1::ParetoFront ParetoToProto(const ParetoResult& result, const ParetoTask& task, int64_t seed,
                              size_t chosen, v1::Plan::StopReason stop_reason);

// INVALID_ARGUMENT if the content of `path` is incomplete or belongs to another part or task; the
// message names the file, the field, its value and the allowed one. If the front's part digest
// follows another rule, digests cannot be compared: only its other fields are checked, and `remark`
// (may be null) says so.
absl::Status CheckPareto(const v1::ParetoFront& front, const ParetoTask& task,
                         const std::string& path, std::string* remark = nullptr);

// Scans of a point of a checked front.
std::vector<Measurement> ScansOfPoint(const v1::ParetoPoint& point);

// The choice of one point of a front; exactly one is set.
struct ParetoPick {
  std::optional<int> number;      // of the point
  std::optional<int> scans;       // at most so many; chooses the point that satisfies most
  std::optional<double> seconds;  // at most so many; chooses the point that satisfies most
};

// Returns the index of the point. Among points that satisfy equally much it prefers fewer scans,
// then fewer seconds. OUT_OF_RANGE if no point fits; the message states the range of the existing
// ones. INVALID_ARGUMENT if `seconds` is set for a front without costs.
absl::StatusOr<int> PickPoint(const v1::ParetoFront& front, const ParetoPick& pick,
                              const std::string& path);

// INVALID_ARGUMENT if the point's numbers differ from the exact `score` and `time`.
absl::Status CheckSameNumbers(const v1::ParetoPoint& point, const PlanScore& score,
                              const PlanTime& time, const std::string& path);

// The front as a table for the terminal: scans, seconds, satisfied.
std::string SummarisePareto(const v1::ParetoFront& front);

}  // namespace sightline
