// What a planning strategy asks: gains and coverage of scans. The gRPC client implements it; tests
// use analytic ones.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/rig/measurement.h"
#include "core/targets/target_set.h"

namespace sightline {

enum class ScanFeasibility { kFeasible, kCollision, kTravel, kOutOfBounds };

struct ScanGain {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  int32_t new_targets = 0;
  int32_t covered_targets = 0;
  double weighted_gain = 0;
};

struct ScanCoverage {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  TargetBits covered;  // measurable targets only
  // Exact evaluation only:
  TargetBits covered_without_normal_gate;
  int32_t first_frame = 0;
  int32_t last_frame = -1;
  int64_t measurement_points = 0;
};

class GainOracle {
 public:
  virtual ~GainOracle() = default;
  // Measurable targets: those that plans are to cover.
  virtual const TargetBits& measurable() const = 0;
  // Fast estimates, one result per measurement, in order. Infeasible: zero gain.
  virtual absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                                      const TargetBits& covered) = 0;
  virtual absl::StatusOr<std::vector<ScanGain>> WeightedGains(
      std::span<const Measurement> measurements, std::span<const float> weights) = 0;
  virtual absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) = 0;
  virtual absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) = 0;
  // Number of measurements evaluated so far by Gains, WeightedGains and FastCoverage.
  virtual int64_t evaluations() const = 0;
};

}  // namespace sightline
