// SPDX-License-Identifier: Apache-2.0
// The plan that satisfies most within a number of seconds.
//
// It works as the refined strategy, with seconds in place of a number of scans. It first chooses
// from a pool of good scans (timed_choice.h). Then one scan after the other moves in its continuous
// parameters to satisfy most of the remaining targets without making the plan too long, and new
// scans are searched that satisfy most per second. The search uses fast estimates of satisfied
// targets and of frames. Once a scan is in a plan, exact frames replace the estimate; if these make
// the plan too long, the choice is repeated.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/random/random.h"
#include "planning/pareto/plan_time.h"
#include "planning/pareto/timed_choice.h"
#include "planning/strategy/plan_run.h"
#include "planning/strategy/pool/scan_pool.h"
#include "planning/strategy/scan_order.h"
#include "planning/strategy/top_points.h"

namespace sightline {

class TimedSearch {
 public:
  using EstimateFrames = std::function<FrameRange(const Measurement&)>;

  // The run's locked scans are in every plan. An empty `estimate` asks for exact frames. References
  // must outlive the search; `candidates`: scans known to be good.
  TimedSearch(PlanRun& run, const ExecutionModel& execution, double scan_step_m,
              EstimateFrames estimate)
      : run_(run),
        execution_(execution),
        scan_step_m_(scan_step_m),
        estimate_(std::move(estimate)),
        fixed_(run.request().locked.size()),
        random_(DeriveSeed(static_cast<uint64_t>(run.request().seed), 301)),
        pool_(run.gain_model().steps(),
              TargetSample(run.gain_model().measurable(), run.gain_model().steps().size(),
                           kSamplePairs, random_)) {}

  // Fills the pool with the locked scans, then the feasible `candidates`. Call it once,
  // first.
  absl::Status Start(std::span<const Measurement> candidates);
  // Returns the plan's scans without the locked ones. The plan keeps the limit by exact frames and
  // has at most `most_scans` scans, locked ones included. `starts`: initial plans without their
  // locked scans; scans that do not fit are left out. Spends about `evaluations`; with 0 it chooses
  // from known scans only. CANCELLED once the run is stopped.
  absl::StatusOr<std::vector<Measurement>> MostWithin(
      double limit_s, std::span<const std::vector<Measurement>> starts, size_t most_scans,
      int64_t evaluations);

 private:
  // The choice by seconds tries far more plans than the choice by number, so its sample is smaller.
  static constexpr size_t kSamplePairs = 4096;

  struct Scan {
    std::vector<double> x;
    TargetShares shares;  // fast
    bool exact_frames = false;
  };

  // Index of each scan in the pool; nothing for infeasible scans.
  absl::StatusOr<std::vector<std::optional<size_t>>> Add(std::span<const Measurement> scans,
                                                         bool even_if_infeasible = false);
  double ScanS(FrameRange frames) const {
    return ScanTimeS(execution_.costs, scan_step_m_, frames.first, frames.last);
  }
  absl::StatusOr<std::vector<double>> EstimatedS(std::span<const Measurement> scans);
  std::vector<float> KnownFrom(const PoolPlan& plan) const;
  double Worth(const PoolPlan& plan) const { return run_.Worth(KnownFrom(plan)); }
  // The locked scans, then those of `start` that fit and are feasible; improved over the pool.
  absl::StatusOr<PoolPlan> Begin(double limit_s, std::span<const Measurement> start,
                                 size_t most_scans);
  void ImproveFromPool(PoolPlan& plan, double limit_s, size_t most_scans);
  // worth(gain, added seconds) of scans in addition to those of `order`; -1 if they add more than
  // `left_s`. The best points go into `top`, which must outlive the result.
  BatchObjective Timed(const BatchObjective& gain, const std::vector<Measurement>& order,
                       double left_s, TopPoints& top,
                       const std::function<double(double gain, double added_s)>& worth);
  absl::Status Polish(PoolPlan& plan, size_t place, double limit_s, int64_t evaluations);
  absl::Status SearchForSecond(const PoolPlan& plan, double limit_s, int64_t evaluations);
  // Computes exact frames of the plan's scans; infeasible scans leave plan and pool.
  absl::Status MakeExact(PoolPlan& plan);
  TimedChoice Choice() const { return TimedChoice(execution_, pool_, measurements_, scan_s_); }

  PlanRun& run_;
  const ExecutionModel& execution_;
  const double scan_step_m_;
  const EstimateFrames estimate_;
  const size_t fixed_;
  Random random_;
  ScanPool pool_;
  // Scans of the pool; the locked ones come first.
  std::vector<Scan> scans_;
  std::vector<Measurement> measurements_;
  std::vector<double> scan_s_;
  std::map<std::array<double, kMeasurementParameters>, size_t> index_of_;
};

}  // namespace sightline
