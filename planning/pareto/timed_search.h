// SPDX-License-Identifier: Apache-2.0
// The plan that satisfies most within a number of seconds.
//
// As the refined strategy, with seconds in place of a number of scans: choice out of a pool of good
// scans (timed_choice.h), then one scan after the other moves in the continuous parameters to
// satisfy most of the targets that the others leave without making the plan too long, and scans
// are searched that satisfy most per second. The search goes by fast estimates of what a scan
// satisfies and of its frames; exact frames replace these once a scan is in a plan, and a plan that
// they make too long is chosen again.
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

  // The run's locked scans are in every plan. `estimate` may be empty: exact frames are asked.
  // References must outlive the search; `candidates`: scans known to be good.
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

  // Fills the pool: the locked scans, then `candidates` as far as they are feasible. To be called
  // once, first.
  absl::Status Start(std::span<const Measurement> candidates);
  // Scans of the plan without the locked ones, exactly within the limit; of at most `most_scans`
  // in all. `starts`: plans to begin with, without their locked scans; scans that do not fit are
  // left out. May spend about `evaluations`; with 0
  // only known scans are chosen from. CANCELLED once the run is stopped.
  absl::StatusOr<std::vector<Measurement>> MostWithin(
      double limit_s, std::span<const std::vector<Measurement>> starts, size_t most_scans,
      int64_t evaluations);

 private:
  // Choices by seconds try far more plans than those by numbers.
  static constexpr size_t kSamplePairs = 4096;

  struct Scan {
    std::vector<double> x;
    TargetShares shares;  // fast
    bool exact_frames = false;
  };

  // Index of each scan in the pool; none for those that are not feasible.
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
  // Worth of scans in addition to those of `order`: worth(gain, seconds they add); -1 if that is
  // more than `left_s`. The best ones go into `top`, which must outlive it.
  BatchObjective Timed(const BatchObjective& gain, const std::vector<Measurement>& order,
                       double left_s, TopPoints& top,
                       const std::function<double(double gain, double added_s)>& worth);
  absl::Status Polish(PoolPlan& plan, size_t place, double limit_s, int64_t evaluations);
  absl::Status SearchForSecond(const PoolPlan& plan, double limit_s, int64_t evaluations);
  // Exact frames of the plan's scans; those that are infeasible leave plan and pool.
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
