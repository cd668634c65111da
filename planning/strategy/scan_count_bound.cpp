// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/scan_count_bound.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "ClpSimplex.hpp"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/random/random.h"
#include "core/status/status_macros.h"
#include "planning/optimise/maximise.h"
#include "planning/optimise/search_space.h"
#include "planning/strategy/cover_bits.h"
#include "planning/strategy/top_points.h"

namespace sightline {

namespace {

constexpr size_t kMaxGroups = 400;
constexpr size_t kColumnsPerPricing = 24;
constexpr double kColumnSeparation = 0.02;
constexpr int64_t kRoundEvaluations = 3000;
constexpr int kFullRoundRestarts = 5;
constexpr double kMixing = 0.5;
// A scan of weight up to 1 + this tolerance changes the bound by less than the same fraction.
constexpr double kTolerance = 0.005;

// Groups of targets; a scan's targets as group numbers with counts form a row of the programme.
struct Groups {
  std::vector<int> of_target;  // -1: not measurable
  std::vector<double> sizes;
};

// At most kMaxGroups groups of measurable targets that nearly the same columns satisfy, by at least
// half. Centres come from a farthest-first traversal in Hamming distance (Gonzalez 1985).
Groups GroupTargets(const TargetBits& measurable, const std::vector<TargetBits>& columns) {
  const size_t words = (columns.size() + 63) / 64;
  std::vector<size_t> targets;
  for (size_t t = 0; t < measurable.size(); ++t) {
    if (measurable.Test(t)) targets.push_back(t);
  }
  std::vector<TargetBits> signatures(targets.size(), TargetBits(64 * words));
  for (size_t c = 0; c < columns.size(); ++c) {
    for (size_t i = 0; i < targets.size(); ++i) {
      if (columns[c].Test(targets[i])) signatures[i].Set(c);
    }
  }
  Groups groups;
  groups.of_target.assign(measurable.size(), -1);
  std::vector<int64_t> distance(targets.size(), std::numeric_limits<int64_t>::max());
  std::vector<int> nearest(targets.size(), 0);
  size_t centre = 0;
  while (groups.sizes.size() < kMaxGroups && !targets.empty()) {
    const int group = static_cast<int>(groups.sizes.size());
    groups.sizes.push_back(0);
    size_t farthest = 0;
    for (size_t i = 0; i < targets.size(); ++i) {
      if (distance[i] > 0) {
        const int64_t d = CountOnlyIn(signatures[i], signatures[centre]) +
                          CountOnlyIn(signatures[centre], signatures[i]);
        if (d < distance[i]) {
          distance[i] = d;
          nearest[i] = group;
        }
      }
      if (distance[i] > distance[farthest]) farthest = i;
    }
    if (distance[farthest] == 0) break;
    centre = farthest;
  }
  for (size_t i = 0; i < targets.size(); ++i) {
    groups.of_target[targets[i]] = nearest[i];
    groups.sizes[nearest[i]] += 1;
  }
  return groups;
}

// The dual programme over groups; rows are added scan by scan.
// Variables: pi_g (0 .. groups-1), mu_g (groups .. 2 groups - 1), lambda (last).
class WeightProgramme {
 public:
  WeightProgramme(const Groups& groups, int64_t goal_targets) : groups_(groups) {
    const int n = static_cast<int>(groups.sizes.size());
    clp_.setLogLevel(0);
    clp_.resize(0, 2 * n + 1);
    clp_.setOptimizationDirection(-1);
    for (int g = 0; g < n; ++g) {
      // A target that some scan covers has a weight of at most 1.
      clp_.setColumnBounds(g, 0, 1);
      clp_.setColumnBounds(n + g, 0, 1);
      clp_.setObjectiveCoefficient(n + g, -groups.sizes[g]);
    }
    clp_.setColumnBounds(2 * n, 0, 1);
    clp_.setObjectiveCoefficient(2 * n, static_cast<double>(goal_targets));
    for (int g = 0; g < n; ++g) {
      const int indices[] = {g, n + g, 2 * n};
      const double elements[] = {1, 1, -1};
      clp_.addRow(3, indices, elements, 0, COIN_DBL_MAX);
    }
  }

  void AddScan(const TargetShares& scan) {
    std::vector<double> counts(groups_.sizes.size(), 0);
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      const int g = groups_.of_target[scan.targets[i]];
      if (g >= 0) counts[g] += scan.share[i];
    }
    std::vector<int> indices;
    std::vector<double> elements;
    for (size_t g = 0; g < counts.size(); ++g) {
      if (counts[g] == 0) continue;
      indices.push_back(static_cast<int>(g));
      elements.push_back(counts[g]);
    }
    clp_.addRow(static_cast<int>(indices.size()), indices.data(), elements.data(), -COIN_DBL_MAX,
                1);
  }

  // Weight of each target; false when the solver fails.
  bool Solve(std::vector<double>& weights) {
    clp_.dual();
    if (clp_.status() != 0) clp_.primal();
    if (clp_.status() != 0) return false;
    const double* x = clp_.getColSolution();
    weights.assign(groups_.of_target.size(), 0);
    for (size_t t = 0; t < weights.size(); ++t) {
      if (groups_.of_target[t] >= 0) weights[t] = std::max(0.0, x[groups_.of_target[t]]);
    }
    return true;
  }

 private:
  const Groups& groups_;
  ClpSimplex clp_;
};

double WeightOf(const TargetShares& scan, const std::vector<double>& weights) {
  double sum = 0;
  for (size_t i = 0; i < scan.targets.size(); ++i) {
    sum += static_cast<double>(scan.share[i]) * weights[scan.targets[i]];
  }
  return sum;
}

// Targets to which the scan gives at least half of the required information.
TargetBits MostlySatisfied(const TargetShares& scan, size_t targets) {
  TargetBits bits(targets);
  for (size_t i = 0; i < scan.targets.size(); ++i) {
    if (scan.share[i] >= 0.5f) bits.Set(scan.targets[i]);
  }
  return bits;
}

double SumOfSmallest(const TargetBits& measurable, const std::vector<double>& weights,
                     int64_t count) {
  std::vector<double> sorted;
  for (size_t t = 0; t < weights.size(); ++t) {
    if (measurable.Test(t)) sorted.push_back(weights[t]);
  }
  std::sort(sorted.begin(), sorted.end());
  return std::accumulate(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count), 0.0);
}

// Shares of a feasible scan, limited to what a target requires.
TargetShares CountingShares(const GainModel& gain_model, ScanCoverage scan) {
  TargetShares shares =
      gain_model.ScoresPlans() ? std::move(scan.shares) : FullShares(scan.covered);
  for (float& share : shares.share) share = std::min(share, 1.0f);
  return shares;
}

// Sets the whole number and the statement from the other results.
void State(ScanCountBoundResult& result) {
  result.scans = static_cast<int>(std::ceil(result.bound - 1e-6));
  if (result.converged) {
    result.statement = absl::StrFormat(
        "Any plan needs at least %d scans (lower bound %.2f) for %d of %d targets, by the fast "
        "estimate. The last %d of %d evaluations found no scan that would lower the bound by more "
        "than %.1f %%.",
        result.scans, result.bound, result.goal_targets, result.measurable_targets,
        result.last_round_evaluations, result.evaluations, 100 * kTolerance);
  } else {
    result.statement = absl::StrFormat(
        "About %d scans (%.2f) are needed for %d of %d targets by the fast estimate, but this is "
        "no lower bound yet. The search for better scans stopped after %d evaluations while it "
        "still found some: more evaluations (--bound-evaluations) can change the number.",
        result.scans, result.bound, result.goal_targets, result.measurable_targets,
        result.evaluations);
  }
}

class BoundSearch {
 public:
  BoundSearch(GainModel& gain_model, const MeasurementDomain& domain, double goal, int64_t budget,
              int64_t seed, const std::function<void(const ScanCountBoundProgress&)>& on_progress,
              const std::atomic<bool>* interrupted)
      : gain_model_(gain_model),
        space_(domain),
        measurable_(gain_model.measurable()),
        goal_targets_(static_cast<int64_t>(
            std::ceil(goal * static_cast<double>(measurable_.Count()) - 1e-9))),
        budget_(budget),
        random_(DeriveSeed(static_cast<uint64_t>(seed), 17)),
        on_progress_(on_progress),
        interrupted_(interrupted),
        evaluations_before_(gain_model.evaluations()) {}

  absl::StatusOr<ScanCountBoundResult> Run(std::span<const Measurement> initial) {
    absl::Status status = Search(initial);
    if (!status.ok() && !Interrupted()) return status;
    result_.evaluations = Used();
    result_.goal_targets = goal_targets_;
    result_.measurable_targets = measurable_.Count();
    result_.weights = std::move(best_weights_);
    State(result_);
    return result_;
  }

 private:
  int64_t Used() const { return gain_model_.evaluations() - evaluations_before_; }
  int64_t Left() const { return budget_ - Used(); }
  bool Interrupted() const { return interrupted_ != nullptr && *interrupted_; }

  absl::Status Search(std::span<const Measurement> initial) {
    if (goal_targets_ == 0) return absl::OkStatus();
    const int64_t full_round = std::max<int64_t>(1, budget_ / 10);
    SIGHTLINE_RETURN_IF_ERROR(AddColumns({initial.begin(), initial.end()}));
    SIGHTLINE_RETURN_IF_ERROR(SpreadColumns());
    double mixing = kMixing;
    while (Left() > 3 * full_round) {
      SIGHTLINE_RETURN_IF_ERROR(SolveProgramme());
      // Smoothing between the programme's weights and the best known ones reduces their jumps from
      // round to round (Wentges 1997).
      std::vector<double> weights = programme_weights_;
      for (size_t t = 0; t < best_weights_.size(); ++t) {
        weights[t] = mixing * best_weights_[t] + (1 - mixing) * weights[t];
      }
      SIGHTLINE_ASSIGN_OR_RETURN(auto priced,
                                 Price(weights, std::min(Left(), kRoundEvaluations), 1));
      if (priced <= 1 + kTolerance) {
        if (mixing == 0) break;
        mixing = 0;
      } else {
        mixing = kMixing;
      }
    }
    // Check the bound's own weights with the full budget of a round. Regroup by all columns.
    programme_.reset();
    while (Left() > 0) {
      SIGHTLINE_RETURN_IF_ERROR(SolveProgramme());
      Consider(programme_weights_);
      const int64_t evaluations = std::min(Left(), full_round);
      SIGHTLINE_ASSIGN_OR_RETURN(auto priced,
                                 Price(best_weights_, evaluations, kFullRoundRestarts));
      if (priced <= 1 + kTolerance && evaluations == full_round) {
        result_.converged = true;
        break;
      }
    }
    return absl::OkStatus();
  }

  // Solves the programme over the present columns for the weights of all targets.
  absl::Status SolveProgramme() {
    if (!programme_ || columns_.size() >= 2 * grouped_columns_) {
      std::vector<TargetBits> mostly;
      for (const TargetShares& column : columns_) {
        mostly.push_back(MostlySatisfied(column, measurable_.size()));
      }
      groups_ = GroupTargets(measurable_, mostly);
      programme_.emplace(groups_, goal_targets_);
      grouped_columns_ = columns_.size();
      rows_ = 0;
    }
    for (; rows_ < columns_.size(); ++rows_) programme_->AddScan(columns_[rows_]);
    if (!programme_->Solve(programme_weights_)) {
      return absl::InternalError("the linear programme of the bound could not be solved");
    }
    return absl::OkStatus();
  }

  double MostWeight(const std::vector<double>& weights) const {
    double most = 0;
    for (const TargetShares& column : columns_) most = std::max(most, WeightOf(column, weights));
    return most;
  }

  // Scales the weights so that no known scan covers more than 1, and keeps them if their bound
  // exceeds that of the best weights, scaled alike.
  void Consider(std::vector<double> weights) {
    const auto scale = [&](std::vector<double>& w) {
      const double most = MostWeight(w);
      if (most > 0) {
        for (double& weight : w) weight /= most;
      }
      return most > 0 ? SumOfSmallest(measurable_, w, goal_targets_) : 0.0;
    };
    result_.bound = best_weights_.empty() ? 0 : scale(best_weights_);
    const double bound = scale(weights);
    if (best_weights_.empty() || bound > result_.bound) {
      result_.bound = bound;
      best_weights_ = std::move(weights);
    }
    if (on_progress_) on_progress_({result_.bound, Used(), budget_});
  }

  // Fast coverage of scans; the feasible ones become columns.
  absl::Status AddColumns(std::vector<Measurement> scans) {
    scans.resize(std::min<size_t>(scans.size(), static_cast<size_t>(std::max<int64_t>(0, Left()))));
    if (scans.empty()) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, gain_model_.FastCoverage(scans));
    for (size_t i = 0; i < scans.size(); ++i) {
      ScanCoverage& c = coverage[i];
      if (c.feasibility != ScanFeasibility::kFeasible) continue;
      TargetShares shares = CountingShares(gain_model_, std::move(c));
      if (shares.targets.empty()) continue;
      columns_.push_back(std::move(shares));
      result_.generated_columns.push_back(scans[i]);
    }
    return absl::OkStatus();
  }

  // Searches with `evaluations` evaluations for the scan that covers most weight and returns that
  // weight. The best different scans become columns; the weights are considered for the bound.
  absl::StatusOr<double> Price(const std::vector<double>& weights, int64_t evaluations,
                               int restarts) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto priced, PriceOnly(weights, evaluations, restarts));
    Consider(weights);
    ++result_.rounds;
    result_.last_round_evaluations = evaluations;
    return priced;
  }

  absl::StatusOr<double> PriceOnly(const std::vector<double>& weights, int64_t evaluations,
                                   int restarts) {
    const std::vector<float> weights_f(weights.begin(), weights.end());
    TopPoints top(kColumnsPerPricing, kColumnSeparation);
    const BatchObjective objective =
        [&](std::span<const std::vector<double>> points) -> absl::StatusOr<std::vector<double>> {
      if (Interrupted()) return absl::CancelledError("interrupted");
      std::vector<Measurement> measurements;
      for (const auto& x : points) measurements.push_back(space_.ToMeasurement(x));
      SIGHTLINE_ASSIGN_OR_RETURN(auto gains, gain_model_.WeightedGains(measurements, weights_f));
      std::vector<double> values;
      for (size_t i = 0; i < gains.size(); ++i) {
        const bool feasible = gains[i].feasibility == ScanFeasibility::kFeasible;
        values.push_back(feasible ? gains[i].weighted_gain : -1);
        if (values.back() > 0) top.Add(space_.Normalise(points[i]), values.back());
      }
      return values;
    };
    MaximiseOptions options;
    options.periodic = space_.periodic();
    options.restarts = restarts;
    const int64_t searching =
        std::max<int64_t>(1, evaluations - static_cast<int64_t>(kColumnsPerPricing));
    SIGHTLINE_ASSIGN_OR_RETURN(auto best, Maximise(Method::kParticleSwarm, space_.dimension(),
                                                   objective, searching, random_.Bits(), options));
    std::vector<Measurement> scans;
    for (const auto& entry : top.entries()) scans.push_back(space_.ToMeasurement(entry.x));
    SIGHTLINE_RETURN_IF_ERROR(AddColumns(std::move(scans)));
    return std::max(0.0, best.value);
  }

  // First columns: repeated searches in which covered targets have half their weight.
  absl::Status SpreadColumns() {
    std::vector<double> weights(measurable_.size(), 0);
    for (size_t t = 0; t < weights.size(); ++t) weights[t] = measurable_.Test(t) ? 1 : 0;
    const int64_t until = Left() * 4 / 5;
    while (Left() > until) {
      const size_t before = columns_.size();
      SIGHTLINE_RETURN_IF_ERROR(PriceOnly(weights, std::min<int64_t>(Left(), 1000), 1).status());
      if (columns_.size() == before) break;
      const TargetBits satisfied = MostlySatisfied(columns_[before], weights.size());
      for (size_t t = 0; t < weights.size(); ++t) {
        if (satisfied.Test(t)) weights[t] *= 0.5;
      }
    }
    return absl::OkStatus();
  }

  GainModel& gain_model_;
  SearchSpace space_;
  const TargetBits& measurable_;
  const int64_t goal_targets_;
  const int64_t budget_;
  Random random_;
  const std::function<void(const ScanCountBoundProgress&)>& on_progress_;
  const std::atomic<bool>* interrupted_;
  const int64_t evaluations_before_;
  std::vector<TargetShares> columns_;
  Groups groups_;
  std::optional<WeightProgramme> programme_;
  size_t grouped_columns_ = 0;  // number of columns when the groups were made
  size_t rows_ = 0;             // number of columns in the programme
  std::vector<double> programme_weights_;
  std::vector<double> best_weights_;  // scaled: no known scan covers more than 1
  ScanCountBoundResult result_;
};

}  // namespace

absl::StatusOr<ScanCountBoundResult> BoundScanCount(
    GainModel& gain_model, const MeasurementDomain& domain, double goal,
    std::span<const Measurement> initial_scans, int64_t budget, int64_t seed,
    const std::function<void(const ScanCountBoundProgress&)>& on_progress,
    const std::atomic<bool>* interrupted) {
  if (!(goal > 0 && goal <= 1)) {
    return absl::InvalidArgumentError(absl::StrCat("goal: ", goal, " is not in (0, 1]"));
  }
  if (budget < 1) {
    return absl::InvalidArgumentError(absl::StrCat("budget: ", budget, " is not >= 1"));
  }
  return BoundSearch(gain_model, domain, goal, budget, seed, on_progress, interrupted)
      .Run(initial_scans);
}

absl::Status TakeIntoAccount(GainModel& gain_model, const MeasurementDomain& domain,
                             std::span<const Measurement> plan, ScanCountBoundResult& bound) {
  const bool inside = std::all_of(plan.begin(), plan.end(),
                                  [&](const Measurement& scan) { return domain.Contains(scan); });
  if (bound.weights.empty() || plan.empty() || !inside) return absl::OkStatus();
  SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, gain_model.FastCoverage(plan));
  double heaviest = 1;
  for (ScanCoverage& scan : coverage) {
    if (scan.feasibility != ScanFeasibility::kFeasible) continue;
    heaviest =
        std::max(heaviest, WeightOf(CountingShares(gain_model, std::move(scan)), bound.weights));
  }
  bound.converged = bound.converged && heaviest <= 1 + kTolerance;
  bound.bound = std::min(bound.bound / heaviest, static_cast<double>(plan.size()));
  for (double& weight : bound.weights) weight /= heaviest;
  State(bound);
  return absl::OkStatus();
}

void LowerGoal(const TargetBits& measurable, int64_t goal_targets, ScanCountBoundResult& bound) {
  if (bound.weights.empty() || goal_targets >= bound.goal_targets) return;
  bound.goal_targets = std::max<int64_t>(0, goal_targets);
  bound.bound = std::min(bound.bound, SumOfSmallest(measurable, bound.weights, bound.goal_targets));
  State(bound);
}

}  // namespace sightline
