// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/timed_search.h"

#include <algorithm>
#include <utility>

#include "core/status/status_macros.h"
#include "planning/optimise/climb.h"
#include "planning/optimise/maximise.h"
#include "planning/strategy/top_points.h"

namespace sightline {
namespace {

constexpr int kPoolRounds = 12;
// Largest number of repeated choices after exact frames made a plan too long.
constexpr int kMaxCorrections = 4;
constexpr int64_t kPolishBatches = 6;
constexpr int kSwarm = 50;
constexpr size_t kKeptPerSearch = 32;
constexpr size_t kKeptPerPolish = 4;
constexpr double kKeptSeparation = 0.03;
// Prefers the quicker scan among equal gains; these differences add up to less than one target.
constexpr double kTieBreak = 1e-3;
// Lower limit of a scan's time in gain per second, for scans without travel and repositioning.
constexpr double kLeastTimeInSearch_s = 0.1;

}  // namespace

absl::StatusOr<std::vector<double>> TimedSearch::EstimatedS(std::span<const Measurement> scans) {
  std::vector<double> seconds;
  if (estimate_) {
    for (const Measurement& scan : scans) seconds.push_back(ScanS(estimate_(scan)));
    return seconds;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, run_.Exact(scans));
  for (const ScanCoverage* scan : exact) {
    seconds.push_back(ScanS({scan->first_frame, scan->last_frame}));
  }
  return seconds;
}

absl::StatusOr<std::vector<std::optional<size_t>>> TimedSearch::Add(
    std::span<const Measurement> scans, bool even_if_infeasible) {
  std::vector<std::optional<size_t>> indices(scans.size());
  std::vector<Measurement> missing;
  for (const Measurement& scan : scans) {
    if (!index_of_.contains(ToArray(scan)) &&
        std::find(missing.begin(), missing.end(), scan) == missing.end()) {
      missing.push_back(scan);
    }
  }
  if (!missing.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, run_.gain_model().FastCoverage(missing));
    SIGHTLINE_ASSIGN_OR_RETURN(auto seconds, EstimatedS(missing));
    for (size_t i = 0; i < missing.size(); ++i) {
      ScanCoverage& c = coverage[i];
      const bool feasible = c.feasibility == ScanFeasibility::kFeasible;
      if (!feasible && !even_if_infeasible) continue;
      Scan scan{run_.space().ToUnit(missing[i]), {}, false};
      if (feasible) {
        scan.shares = run_.gain_model().ScoresPlans() ? std::move(c.shares) : FullShares(c.covered);
      }
      index_of_[ToArray(missing[i])] = pool_.Add(scan.shares);
      scans_.push_back(std::move(scan));
      measurements_.push_back(missing[i]);
      scan_s_.push_back(seconds[i]);
    }
  }
  for (size_t i = 0; i < scans.size(); ++i) {
    if (const auto found = index_of_.find(ToArray(scans[i])); found != index_of_.end()) {
      indices[i] = found->second;
    }
  }
  return indices;
}

std::vector<float> TimedSearch::KnownFrom(const PoolPlan& plan) const {
  std::vector<float> known = run_.NothingKnown();
  for (const size_t scan : plan) AddShares(scans_[scan].shares, known);
  return known;
}

absl::Status TimedSearch::Start(std::span<const Measurement> candidates) {
  SIGHTLINE_RETURN_IF_ERROR(Add(run_.request().locked, true).status());
  return Add(candidates).status();
}

void TimedSearch::ImproveFromPool(PoolPlan& plan, double limit_s, size_t most_scans) {
  const PoolPlan better = Choice().Improve(plan, fixed_, limit_s, most_scans, kPoolRounds, random_,
                                           [this] { return run_.Stopped(); });
  // The pool uses only a sample of the targets, so compare over all targets.
  if (Worth(better) >= Worth(plan)) plan = better;
}

BatchObjective TimedSearch::Timed(const BatchObjective& gain, const std::vector<Measurement>& order,
                                  double left_s, TopPoints& top,
                                  const std::function<double(double gain, double added_s)>& worth) {
  return [=, this, &top](
             std::span<const std::vector<double>> points) -> absl::StatusOr<std::vector<double>> {
    SIGHTLINE_ASSIGN_OR_RETURN(auto values, gain(points));
    std::vector<Measurement> scans;
    for (const auto& x : points) scans.push_back(run_.space().ToMeasurement(x));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto seconds, EstimatedS(scans));
    for (size_t i = 0; i < points.size(); ++i) {
      double& value = values[i];
      if (value <= 0) continue;
      const double added_s = Choice().AddedS(order, fixed_, scans[i], seconds[i]);
      value = added_s > left_s ? -1 : worth(value, added_s);
      if (value > 0) top.Add(run_.space().Normalise(points[i]), value);
    }
    return values;
  };
}

absl::Status TimedSearch::Polish(PoolPlan& plan, size_t place, double limit_s,
                                 int64_t evaluations) {
  if (run_.space().dimension() == 0) return absl::OkStatus();
  PoolPlan others = Choice().InOrder(plan, fixed_);
  others.erase(std::find(others.begin(), others.end(), plan[place]));
  std::vector<Measurement> order;
  for (const size_t scan : others) order.push_back(measurements_[scan]);
  const double left_s = limit_s - Choice().TimeS(others, fixed_);
  TopPoints top(kKeptPerPolish, 0.005);
  const BatchObjective gain =
      run_.Gain(KnownFrom(others), nullptr, "polishing", static_cast<int64_t>(plan.size()));
  const BatchObjective objective =
      Timed(gain, order, left_s, top, [&](double value, double added_s) {
        return value - kTieBreak * std::max(0.0, added_s) / std::max(left_s, kLeastTimeInSearch_s);
      });
  std::vector<double> x = scans_[plan[place]].x;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto own, objective(std::span(&x, 1)));
  const int64_t batches = std::max<int64_t>(1, evaluations / kClimbBatch);
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto climbed,
      Climb(
          std::move(x), own.front(), batches, objective,
          [this](std::span<const double> y) { return run_.space().Normalise(y); }, random_));
  std::vector<Measurement> found;
  for (const auto& entry : top.entries()) found.push_back(run_.space().ToMeasurement(entry.x));
  if (climbed.moved) found.push_back(run_.space().ToMeasurement(climbed.x));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto indices, Add(found));
  if (climbed.moved && climbed.value > 0 && indices.back() &&
      std::find(plan.begin(), plan.end(), *indices.back()) == plan.end()) {
    plan[place] = *indices.back();
  }
  return absl::OkStatus();
}

absl::Status TimedSearch::SearchForSecond(const PoolPlan& plan, double limit_s,
                                          int64_t evaluations) {
  // Removes the scan with the least worth per second.
  PoolPlan others = plan;
  if (others.size() > fixed_) {
    Choice().Shorten(others, fixed_, std::nexttoward(Choice().TimeS(plan, fixed_), 0.0L));
  }
  std::vector<Measurement> order;
  for (const size_t scan : Choice().InOrder(others, fixed_)) order.push_back(measurements_[scan]);
  const double left_s = limit_s - Choice().TimeS(others, fixed_);
  TopPoints top(kKeptPerSearch, kKeptSeparation);
  const BatchObjective gain = run_.Gain(KnownFrom(others), nullptr, "searching quick scans",
                                        static_cast<int64_t>(plan.size()));
  const BatchObjective objective = Timed(
      gain, order, left_s, top,
      [](double value, double added_s) { return value / std::max(kLeastTimeInSearch_s, added_s); });
  MaximiseOptions options;
  options.periodic = run_.space().periodic();
  options.population = kSwarm;
  SIGHTLINE_RETURN_IF_ERROR(Maximise(Method::kParticleSwarm, run_.space().dimension(), objective,
                                     std::max<int64_t>(1, evaluations), random_.Bits(), options)
                                .status());
  std::vector<Measurement> found;
  for (const auto& entry : top.entries()) found.push_back(run_.space().ToMeasurement(entry.x));
  return Add(found).status();
}

absl::Status TimedSearch::MakeExact(PoolPlan& plan) {
  std::vector<Measurement> scans;
  for (const size_t scan : plan) scans.push_back(measurements_[scan]);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto exact, run_.Exact(scans));
  PoolPlan kept;
  for (size_t i = 0; i < plan.size(); ++i) {
    const ScanCoverage& coverage = *exact[i];
    if (coverage.feasibility != ScanFeasibility::kFeasible && i >= fixed_) {
      scans_[plan[i]].shares = {};
      pool_.Empty(plan[i]);
      continue;
    }
    scan_s_[plan[i]] = ScanS({coverage.first_frame, coverage.last_frame});
    kept.push_back(plan[i]);
  }
  plan = std::move(kept);
  return absl::OkStatus();
}

absl::StatusOr<PoolPlan> TimedSearch::Begin(double limit_s, std::span<const Measurement> start,
                                            size_t most_scans) {
  PoolPlan plan;
  for (size_t scan = 0; scan < fixed_; ++scan) plan.push_back(scan);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto given, Add(start));
  for (const auto& index : given) {
    if (index && std::find(plan.begin(), plan.end(), *index) == plan.end()) plan.push_back(*index);
  }
  SIGHTLINE_RETURN_IF_ERROR(MakeExact(plan));
  Choice().Shorten(plan, fixed_, limit_s);
  ImproveFromPool(plan, limit_s, most_scans);
  return plan;
}

absl::StatusOr<std::vector<Measurement>> TimedSearch::MostWithin(
    double limit_s, std::span<const std::vector<Measurement>> starts, size_t most_scans,
    int64_t evaluations) {
  PoolPlan plan;
  for (size_t i = 0; i < std::max<size_t>(1, starts.size()); ++i) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto begun,
        Begin(limit_s, starts.empty() ? std::vector<Measurement>{} : starts[i], most_scans));
    if (i == 0 || Worth(begun) > Worth(plan)) plan = std::move(begun);
  }

  const int64_t before = run_.evaluations();
  bool going = evaluations > 0;
  if (going) {
    SIGHTLINE_RETURN_IF_ERROR(SearchForSecond(plan, limit_s, evaluations / 4));
    ImproveFromPool(plan, limit_s, most_scans);
  }
  while (going && plan.size() > fixed_) {
    const double worth = Worth(plan);
    for (size_t place = fixed_; place < plan.size() && going; ++place) {
      SIGHTLINE_RETURN_IF_ERROR(Polish(plan, place, limit_s, kPolishBatches * kClimbBatch));
      going = run_.evaluations() - before < evaluations;
    }
    ImproveFromPool(plan, limit_s, most_scans);
    going = going && Worth(plan) > worth;
  }

  for (int correction = 0; correction < kMaxCorrections; ++correction) {
    const size_t size = plan.size();
    SIGHTLINE_RETURN_IF_ERROR(MakeExact(plan));
    if (plan.size() == size && Choice().TimeS(plan, fixed_) <= limit_s) break;
    Choice().Shorten(plan, fixed_, limit_s);
    ImproveFromPool(plan, limit_s, most_scans);
  }
  // If the plan is still too long after kMaxCorrections, it loses its weakest scans.
  SIGHTLINE_RETURN_IF_ERROR(MakeExact(plan));
  Choice().Shorten(plan, fixed_, limit_s);
  std::vector<Measurement> scans;
  for (size_t place = fixed_; place < plan.size(); ++place) {
    scans.push_back(measurements_[plan[place]]);
  }
  return scans;
}

}  // namespace sightline
