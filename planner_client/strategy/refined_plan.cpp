#include "planner_client/strategy/refined_plan.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "absl/strings/str_cat.h"
#include "planner_client/optimise/random.h"
#include "planner_client/strategy/cover_bits.h"
#include "planner_client/strategy/scan_pool.h"

namespace sightline {

namespace {

// Shares of request().evaluations_per_scan, and sizes. First choices: the few variants tried on the
// example part did no better.
constexpr double kGreedyShare = 0.25;
constexpr double kRelocateShare = 0.15;
constexpr double kPolishShare = 0.05;
constexpr int kSwarm = 50;
constexpr int64_t kPolishBatch = 64;
constexpr int64_t kKeptPerSearch = 48;
constexpr int64_t kKeptPerPolish = 4;
constexpr double kKeptSeparation = 0.03;
constexpr size_t kMaxPool = 1600;
constexpr int kPoolRounds = 20;
// The search over the pool looks at this many random targets when there are clearly more.
constexpr size_t kSampleTargets = 4096;

struct Scan {
  std::vector<double> x;
  Measurement measurement;
};

class RefinedPlanner {
 public:
  explicit RefinedPlanner(PlanRun& run)
      : run_(run),
        targets_(run.oracle().measurable().size()),
        fixed_(run.request().locked.size()),
        random_(DeriveSeed(static_cast<uint64_t>(run.request().seed), 1)),
        aim_(run.goal_targets()) {
    for (size_t t = 0; t < targets_; ++t) {
      if (run.oracle().measurable().Test(t)) sample_.push_back(t);
    }
    if (sample_.size() > kSampleTargets * 5 / 4) {
      for (size_t i = 0; i < kSampleTargets; ++i) {
        const auto left = static_cast<int64_t>(sample_.size() - i);
        std::swap(sample_[i], sample_[i + static_cast<size_t>(random_.Below(left))]);
      }
      sample_.resize(kSampleTargets);
      std::sort(sample_.begin(), sample_.end());
    }
  }

  absl::StatusOr<PlannerResult> Plan() {
    const absl::Status status = Search();
    if (!status.ok() && !run_.IsStop(status)) return status;
    const PoolPlan& plan = have_best_ ? best_ : plan_;
    if (!status.ok()) reason_ = run_.stopped_reason();
    std::vector<Measurement> movable;
    for (size_t place = fixed_; place < plan.size(); ++place) {
      movable.push_back(scans_[plan[place]].measurement);
    }
    auto result = run_.Finish(movable, reason_);
    // A search that was cut short says so, even if its plan happens to reach the goal.
    if (status.ok() && result.ok() && result->coverage_curve.size() > 0 &&
        result->scans.back().exact.covered.size() > 0) {
      TargetBits covered(targets_);
      for (const ChosenScan& scan : result->scans) covered |= scan.exact.covered;
      if (covered.Count() >= run_.goal_targets()) result->stop_reason = StopReason::kGoalReached;
    }
    return result;
  }

 private:
  absl::Status Search() {
    if (auto status = AddGivenScans(); !status.ok()) return status;
    if (run_.goal_targets() == 0) return absl::OkStatus();
    if (auto status = CompletePlan(); !status.ok()) return status;
    if (auto status = Calibrate(); !status.ok()) return status;
    int rounds_without_progress = 0;
    while (true) {
      if (run_.Stopped()) return absl::CancelledError("planning was stopped");
      if (Covered() >= aim_) {
        if (auto status = Verify(); !status.ok()) return status;
        rounds_without_progress = 0;
        if (have_best_ && best_.size() == plan_.size()) {
          if (plan_.size() <= std::max<size_t>(1, fixed_)) break;
          DropOne();
        }
        continue;
      }
      if (OutOfBudget()) {
        // A plan that never reached the goal takes another scan, within its larger budget.
        if (have_best_ || stalled_ || !RoomForMore()) break;
        if (auto status = AddNextBest(); !status.ok()) return status;
        continue;
      }
      const int64_t before = Covered();
      const int64_t evaluations_before = run_.evaluations();
      ImproveFromPool();
      if (Covered() < aim_) {
        if (auto status = PolishRound(); !status.ok()) return status;
      }
      rounds_without_progress = Covered() > before ? 0 : rounds_without_progress + 1;
      if (Covered() < aim_ && rounds_without_progress > 0) {
        if (auto status = RelocateWeakest(rounds_without_progress); !status.ok()) return status;
      }
      // Nothing may move: no free scan or no free parameter.
      if (Covered() < aim_ && run_.evaluations() == evaluations_before) break;
    }
    return absl::OkStatus();
  }

  bool RoomForMore() const {
    return static_cast<int>(plan_.size()) < run_.request().goal.max_scans;
  }

  // Gain evaluations left of what greedy planning may use for as many scans.
  int64_t Left() const {
    const size_t scans = have_best_ ? best_.size() : std::max<size_t>(1, plan_.size());
    return run_.request().evaluations_per_scan * static_cast<int64_t>(scans) - run_.evaluations();
  }

  int64_t Share(double share) const {
    return std::max<int64_t>(
        1, static_cast<int64_t>(share * static_cast<double>(run_.request().evaluations_per_scan)));
  }

  int64_t PolishBatches() const {
    return std::max<int64_t>(2, (Share(kPolishShare) + kPolishBatch - 1) / kPolishBatch);
  }

  bool OutOfBudget() const { return Left() < PolishBatches() * kPolishBatch + kKeptPerPolish + 1; }

  int64_t Covered() const { return CoveredBy(coverage_, plan_, targets_).Count(); }

  std::string Phase(const char* what) const {
    return have_best_ ? absl::StrCat(what, ", trying ", plan_.size(), " scans") : what;
  }

  // Fast coverage of scans; feasible ones go into the pool. Returns the index of each or none.
  absl::StatusOr<std::vector<std::optional<size_t>>> AddToPool(const std::vector<Scan>& scans,
                                                               bool even_if_infeasible = false) {
    std::vector<std::optional<size_t>> indices;
    if (scans.empty()) return indices;
    std::vector<Measurement> measurements;
    for (const Scan& scan : scans) measurements.push_back(scan.measurement);
    auto coverage = run_.oracle().FastCoverage(measurements);
    if (!coverage.ok()) return coverage.status();
    for (size_t i = 0; i < scans.size(); ++i) {
      ScanCoverage& c = (*coverage)[i];
      if (c.feasibility != ScanFeasibility::kFeasible && !even_if_infeasible) {
        indices.push_back(std::nullopt);
        continue;
      }
      if (c.covered.size() != targets_) c.covered = TargetBits(targets_);
      indices.push_back(coverage_.size());
      scans_.push_back(scans[i]);
      TargetBits sampled(sample_.size());
      for (size_t s = 0; s < sample_.size(); ++s) {
        if (c.covered.Test(sample_[s])) sampled.Set(s);
      }
      sampled_.push_back(std::move(sampled));
      coverage_.push_back(std::move(c.covered));
    }
    return indices;
  }

  std::vector<Scan> ScansOf(const TopPoints& top) const {
    std::vector<Scan> scans;
    for (const auto& entry : top.entries()) {
      scans.push_back({entry.x, run_.space().ToMeasurement(entry.x)});
    }
    return scans;
  }

  absl::Status AddGivenScans() {
    for (const auto* given : {&run_.request().locked, &run_.request().starting}) {
      std::vector<Scan> scans;
      for (const Measurement& measurement : *given) {
        scans.push_back({run_.space().ToUnit(measurement), measurement});
      }
      auto indices = AddToPool(scans, true);
      if (!indices.ok()) return indices.status();
      for (const auto& index : *indices) plan_.push_back(*index);
    }
    return absl::OkStatus();
  }

  // A global search for scans that cover most of what `covered` lacks; the best different ones go
  // into the pool. Returns the best one's index, none if nothing new was found.
  absl::StatusOr<std::optional<size_t>> SearchScan(const TargetBits& covered, int64_t evaluations,
                                                   const std::string& phase) {
    // A tenth of the evaluations at most goes into coverage.
    const int64_t kept = std::clamp<int64_t>(evaluations / 10, 1, kKeptPerSearch);
    TopPoints top(static_cast<size_t>(kept), kKeptSeparation);
    MaximiseOptions options;
    options.periodic = run_.space().periodic();
    options.population = kSwarm;
    auto best = Maximise(Method::kParticleSwarm, run_.space().dimension(),
                         run_.NewTargets(covered, &top, phase, static_cast<int64_t>(plan_.size())),
                         std::max<int64_t>(1, evaluations - kept), random_.Bits(), options);
    if (!best.ok()) return best.status();
    auto indices = AddToPool(ScansOf(top));
    if (!indices.ok()) return indices.status();
    if (indices->empty() || top.entries()[0].value < 1) return std::nullopt;
    return (*indices)[0];
  }

  absl::Status AddNextBest() {
    auto index = SearchScan(CoveredBy(coverage_, plan_, targets_), Share(kGreedyShare),
                            absl::StrCat("searching scan ", plan_.size() + 1));
    if (!index.ok()) return index.status();
    if (!*index || CountOnlyIn(coverage_[**index], CoveredBy(coverage_, plan_, targets_)) <
                       run_.min_new_targets()) {
      if (++failures_ == 2) stalled_ = true;
      reason_ = StopReason::kStalled;
      return absl::OkStatus();
    }
    failures_ = 0;
    plan_.push_back(**index);
    return absl::OkStatus();
  }

  absl::Status CompletePlan() {
    while (Covered() < aim_ && !stalled_) {
      if (!RoomForMore()) {
        reason_ = StopReason::kMaxScans;
        break;
      }
      if (auto status = AddNextBest(); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  // Exact coverage of the plan; scans that are infeasible exactly leave plan and pool.
  absl::StatusOr<int64_t> ExactCovered() {
    std::vector<Measurement> measurements;
    for (size_t set : plan_) measurements.push_back(scans_[set].measurement);
    auto exact = run_.Exact(measurements);
    if (!exact.ok()) return exact.status();
    TargetBits covered(targets_);
    PoolPlan feasible;
    for (size_t i = 0; i < plan_.size(); ++i) {
      if ((*exact)[i]->feasibility == ScanFeasibility::kFeasible) {
        covered |= (*exact)[i]->covered;
        feasible.push_back(plan_[i]);
      } else {
        coverage_[plan_[i]] = TargetBits(targets_);
        sampled_[plan_[i]] = TargetBits(sample_.size());
      }
    }
    plan_ = std::move(feasible);
    return covered.Count();
  }

  // Shifts the fast number of targets to aim at by the difference between fast and exact.
  absl::Status Calibrate() {
    auto exact = ExactCovered();
    if (!exact.ok()) return exact.status();
    exact_covered_ = *exact;
    aim_ = std::max<int64_t>(1, run_.goal_targets() + Covered() - *exact);
    return absl::OkStatus();
  }

  // The plan covers what was aimed at: is that so exactly?
  absl::Status Verify() {
    const size_t size = plan_.size();
    auto exact = ExactCovered();
    if (!exact.ok()) return exact.status();
    exact_covered_ = *exact;
    if (*exact >= run_.goal_targets()) {
      have_best_ = true;
      best_ = plan_;
      run_.Report("reached the goal", static_cast<int64_t>(plan_.size()), *exact, true);
      aim_ = std::max<int64_t>(1, run_.goal_targets() + Covered() - *exact);
      return absl::OkStatus();
    }
    aim_ = run_.goal_targets() + Covered() - *exact;
    if (plan_.size() < size) CompleteGreedily(coverage_, plan_, size, aim_, targets_);
    return absl::OkStatus();
  }

  // Leaves out the scan whose loss the pool can best make good.
  void DropOne() {
    PoolPlan best_plan;
    int64_t best = -1;
    for (size_t place = fixed_; place < plan_.size(); ++place) {
      PoolPlan trial = plan_;
      trial.erase(trial.begin() + static_cast<std::ptrdiff_t>(place));
      ExchangeWhileBetter(sampled_, trial, fixed_, sample_.size());
      const int64_t covered = CoveredBy(coverage_, trial, targets_).Count();
      if (covered > best) {
        best = covered;
        best_plan = trial;
      }
    }
    plan_ = best_plan;
  }

  void ImproveFromPool() {
    LimitPool();
    run_.Report(Phase("exchanging scans"), static_cast<int64_t>(plan_.size()), exact_covered_);
    const PoolPlan better =
        ImproveCoverage(sampled_, plan_, fixed_, static_cast<int64_t>(sample_.size()), kPoolRounds,
                        sample_.size(), random_, [this] { return run_.Stopped(); });
    if (CoveredBy(coverage_, better, targets_).Count() >= Covered()) plan_ = better;
  }

  // Forgets the scans that add least to the present plan.
  void LimitPool() {
    if (coverage_.size() <= kMaxPool) return;
    const TargetBits covered = CoveredBy(coverage_, plan_, targets_);
    const std::vector<TargetBits> unique = UniqueTargets(coverage_, plan_, targets_);
    // What the best exchange for the scan would gain.
    std::vector<int64_t> worth(coverage_.size(), -static_cast<int64_t>(targets_));
    for (size_t set = 0; set < coverage_.size(); ++set) {
      for (const TargetBits& bits : unique) {
        worth[set] = std::max(worth[set], CountInBoth(coverage_[set], bits) - bits.Count());
      }
      worth[set] += CountOnlyIn(coverage_[set], covered);
    }
    for (const PoolPlan* kept : {&plan_, &best_}) {
      for (size_t set : *kept) worth[set] = static_cast<int64_t>(targets_) + 1;
    }
    std::vector<size_t> order(coverage_.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return worth[a] > worth[b]; });
    order.resize(kMaxPool / 2);
    std::sort(order.begin(), order.end());
    std::vector<size_t> place_of(coverage_.size());
    std::vector<Scan> scans;
    std::vector<TargetBits> coverage, sampled;
    for (size_t set : order) {
      place_of[set] = scans.size();
      scans.push_back(std::move(scans_[set]));
      coverage.push_back(std::move(coverage_[set]));
      sampled.push_back(std::move(sampled_[set]));
    }
    scans_ = std::move(scans);
    coverage_ = std::move(coverage);
    sampled_ = std::move(sampled);
    for (PoolPlan* kept : {&plan_, &best_}) {
      for (size_t& set : *kept) set = place_of[set];
    }
  }

  TargetBits CoveredByOthers(size_t place) const {
    PoolPlan others = plan_;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(place));
    return CoveredBy(coverage_, others, targets_);
  }

  // Places of scans that may move, the one with the fewest targets of its own first.
  std::vector<size_t> WeakestFirst() const {
    const std::vector<TargetBits> unique = UniqueTargets(coverage_, plan_, targets_);
    std::vector<size_t> places;
    for (size_t place = fixed_; place < plan_.size(); ++place) places.push_back(place);
    std::stable_sort(places.begin(), places.end(),
                     [&](size_t a, size_t b) { return unique[a].Count() < unique[b].Count(); });
    return places;
  }

  // Moves every scan once to where it covers most of what the others leave.
  absl::Status PolishRound() {
    for (size_t place : WeakestFirst()) {
      if (OutOfBudget() || Covered() >= aim_) break;
      if (auto status = Polish(place); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  // Evolution strategy around the scan: a batch of mutations of the best point so far, mostly of
  // a few coordinates, with a step that shrinks when nothing improves.
  absl::Status Polish(size_t place) {
    const TargetBits others = CoveredByOthers(place);
    const int dimension = run_.space().dimension();
    if (dimension == 0) return absl::OkStatus();
    TopPoints top(kKeptPerPolish, 0.005);
    const BatchObjective objective =
        run_.NewTargets(others, &top, Phase("polishing"), static_cast<int64_t>(plan_.size()));
    std::vector<double> x = scans_[plan_[place]].x;
    auto value = static_cast<double>(CountOnlyIn(coverage_[plan_[place]], others));
    const double start_value = value;
    bool moved = false;
    double step = 0.1;
    for (int64_t batch = 0; batch < PolishBatches(); ++batch) {
      std::vector<std::vector<double>> points;
      for (int64_t i = 0; i < kPolishBatch; ++i) {
        std::vector<double> y = x;
        const double scale = step * std::exp(random_.Normal());
        const double share = i % 2 == 0 ? 1.0 : 2.0 / dimension;
        for (double& coordinate : y) {
          if (random_.Uniform() < share) coordinate += scale * random_.Normal();
        }
        points.push_back(run_.space().Normalise(y));
      }
      auto values = objective(points);
      if (!values.ok()) return values.status();
      const auto best = std::max_element(values->begin(), values->end());
      if (*best >= value) {
        moved = true;
        step = *best > value ? step : step * 0.7;
        value = *best;
        x = points[static_cast<size_t>(best - values->begin())];
      } else {
        step *= 0.5;
      }
    }
    std::vector<Scan> scans = ScansOf(top);
    if (moved) scans.push_back({x, run_.space().ToMeasurement(x)});
    auto indices = AddToPool(scans);
    if (!indices.ok()) return indices.status();
    if (moved && value >= start_value && indices->back()) plan_[place] = *indices->back();
    return absl::OkStatus();
  }

  // Searches the weakest scan (after failures: the next weakest) anew.
  absl::Status RelocateWeakest(int failures) {
    const std::vector<size_t> places = WeakestFirst();
    if (places.empty() || OutOfBudget()) return absl::OkStatus();
    const size_t place = places[static_cast<size_t>(failures - 1) % places.size()];
    const TargetBits others = CoveredByOthers(place);
    auto index =
        SearchScan(others, std::min(Left(), Share(kRelocateShare)), Phase("searching a scan anew"));
    if (!index.ok()) return index.status();
    if (*index &&
        CountOnlyIn(coverage_[**index], others) >= CountOnlyIn(coverage_[plan_[place]], others)) {
      plan_[place] = **index;
    }
    return absl::OkStatus();
  }

  PlanRun& run_;
  const size_t targets_;
  const size_t fixed_;  // the first scans of a plan are locked
  Random random_;
  int64_t aim_;  // fast targets to cover
  std::vector<Scan> scans_;
  std::vector<TargetBits> coverage_;  // fast, of each of scans_
  std::vector<size_t> sample_;        // targets the search over the pool looks at
  std::vector<TargetBits> sampled_;   // coverage_ of those
  PoolPlan plan_;
  PoolPlan best_;  // its exact coverage reaches the goal
  bool have_best_ = false;
  bool stalled_ = false;
  int failures_ = 0;
  int64_t exact_covered_ = 0;
  StopReason reason_ = StopReason::kStalled;
};

}  // namespace

absl::StatusOr<PlannerResult> PlanRefined(PlanRun& run) { return RefinedPlanner(run).Plan(); }

}  // namespace sightline
