// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/refined_plan.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/random/random.h"
#include "core/status/status_macros.h"
#include "planning/optimise/climb.h"
#include "planning/strategy/pool/scan_pool.h"

namespace sightline {

namespace {

// Fractions of request().evaluations_per_scan, and sizes. The few variants tried on the example
// part (greedy fraction 0.25 or 0.9, more polishing) were not better.
constexpr double kGreedyShare = 0.5;
constexpr double kRelocateShare = 0.15;
constexpr double kPolishShare = 0.05;
constexpr int kSwarm = 50;
constexpr int64_t kKeptPerSearch = 48;
constexpr int64_t kKeptPerPolish = 4;
constexpr double kKeptSeparation = 0.03;
constexpr size_t kMaxPool = 4000;
// With this sample size, a fraction of 0.95 has a standard error of 0.002.
constexpr size_t kSamplePairs = 16384;
constexpr int64_t kExchanges = 100'000;
// Number of rounds (exchange, polish, search again) over which progress is averaged.
constexpr size_t kPaceRounds = 2;

struct Scan {
  std::vector<double> x;
  Measurement measurement;
  TargetShares shares;  // fast
};

class RefinedPlanner {
 public:
  explicit RefinedPlanner(PlanRun& run)
      : run_(run),
        fixed_(run.request().locked.size()),
        random_(DeriveSeed(static_cast<uint64_t>(run.request().seed), 1)),
        aim_(run.goal_targets()),
        pool_(run.gain_model().steps(),
              TargetSample(run.gain_model().measurable(), run.gain_model().steps().size(),
                           kSamplePairs, random_)) {}

  absl::StatusOr<PlannerResult> Plan() {
    const absl::Status status = Search();
    if (!status.ok() && !run_.IsStop(status)) return status;
    if (!status.ok()) reason_ = run_.stopped_reason();
    // Tries the smallest plan first. If goals were estimated from a subset of the targets, a plan
    // may narrowly miss the goal.
    while (true) {
      const std::vector<Measurement> movable = reached_.empty() ? Movable() : reached_.back();
      auto result = run_.Finish(movable, reason_);
      if (!result.ok()) return result;
      const bool reaches = run_.ReachesGoal(result->score);
      if (!reaches && reached_.size() > 1) {
        reached_.pop_back();
        continue;
      }
      // An interrupted search reports that as its stop reason, even if its plan reaches the goal.
      if (status.ok() && reaches) result->stop_reason = StopReason::kGoalReached;
      for (const Scan& scan : scans_) {
        if (!scan.shares.targets.empty()) result->candidates.push_back(scan.measurement);
      }
      return result;
    }
  }

 private:
  absl::Status Search() {
    SIGHTLINE_RETURN_IF_ERROR(AddGivenScans());
    if (run_.goal_targets() == 0) return absl::OkStatus();
    SIGHTLINE_RETURN_IF_ERROR(CompletePlan());
    SIGHTLINE_RETURN_IF_ERROR(Calibrate());
    int rounds_without_progress = 0;
    while (true) {
      if (run_.Stopped()) return absl::CancelledError("planning was stopped");
      if (Covered() >= aim_) {
        rounds_without_progress = 0;
        rounds_.clear();
        // Exact scores take longer than exchanges, so only the smallest plan that exchanges alone
        // reach is scored.
        const bool least = plan_.size() <= std::max<size_t>(1, fixed_);
        if (!least && FewerReach()) continue;
        SIGHTLINE_RETURN_IF_ERROR(Verify());
        if (have_best_ && best_.size() == plan_.size()) {
          if (least || run_.request().draft) break;
          plan_ = waiting_;
        }
        continue;
      }
      if (OutOfBudget()) {
        // A plan that never reached the goal gets another scan, which also enlarges its budget.
        if (have_best_ || stalled_ || !RoomForMore()) break;
        SIGHTLINE_RETURN_IF_ERROR(AddNextBest());
        rounds_.clear();
        continue;
      }
      if (OutOfReach()) break;
      const int64_t before = Covered();
      const int64_t evaluations_before = run_.evaluations();
      ImproveFromPool();
      if (Covered() < aim_) {
        SIGHTLINE_RETURN_IF_ERROR(PolishRound());
      }
      rounds_without_progress = Covered() > before ? 0 : rounds_without_progress + 1;
      if (Covered() < aim_ && rounds_without_progress > 0) {
        SIGHTLINE_RETURN_IF_ERROR(RelocateWeakest(rounds_without_progress));
      }
      rounds_.push_back({run_.evaluations(), Covered()});
      // Nothing can move: there is no free scan or no free parameter.
      if (Covered() < aim_ && run_.evaluations() == evaluations_before) break;
    }
    return absl::OkStatus();
  }

  // Scans of the plan that are not locked.
  std::vector<Measurement> Movable() const {
    std::vector<Measurement> movable;
    for (size_t place = fixed_; place < plan_.size(); ++place) {
      movable.push_back(scans_[plan_[place]].measurement);
    }
    return movable;
  }

  bool RoomForMore() const {
    return static_cast<int>(plan_.size()) < run_.request().goal.max_scans;
  }

  // Remaining gain evaluations of the budget of greedy planning for this number of scans.
  int64_t Left() const {
    const size_t scans = have_best_ ? best_.size() : std::max<size_t>(1, plan_.size());
    return run_.request().evaluations_per_scan * static_cast<int64_t>(scans) - run_.evaluations();
  }

  int64_t Share(double share) const {
    return std::max<int64_t>(
        1, static_cast<int64_t>(share * static_cast<double>(run_.request().evaluations_per_scan)));
  }

  int64_t PolishBatches() const {
    return std::max<int64_t>(2, (Share(kPolishShare) + kClimbBatch - 1) / kClimbBatch);
  }

  bool OutOfBudget() const { return Left() < PolishBatches() * kClimbBatch + kKeptPerPolish + 1; }

  // True if, at the progress of the last rounds, a plan with one scan less would miss the goal when
  // the evaluations are used up. Progress slows down, so this is optimistic. Never true if
  // fractions add up: they grow long before they satisfy targets.
  bool OutOfReach() const {
    if (!have_best_ || run_.gain_model().ScoresPlans() || rounds_.size() <= kPaceRounds)
      return false;
    const Round &then = rounds_[rounds_.size() - 1 - kPaceRounds], &now = rounds_.back();
    const auto rounds_left =
        static_cast<double>(Left()) / static_cast<double>(now.evaluations - then.evaluations);
    return static_cast<double>(now.covered - then.covered) * rounds_left <
           static_cast<double>(aim_ - now.covered);
  }

  // Fast estimate of the targets that the plan satisfies.
  int64_t Covered() const { return run_.CountSatisfied(KnownFrom(plan_)); }

  std::vector<float> KnownFrom(const PoolPlan& plan) const {
    std::vector<float> known = run_.NothingKnown();
    for (const size_t scan : plan) AddShares(scans_[scan].shares, known);
    return known;
  }

  std::string Phase(const char* what) const {
    return have_best_ ? absl::StrCat(what, ", trying ", plan_.size(), " scans") : what;
  }

  // Evaluates scans by the fast estimate; feasible ones enter the pool. Returns the index of each,
  // or nothing.
  absl::StatusOr<std::vector<std::optional<size_t>>> AddToPool(std::vector<Scan> scans,
                                                               bool even_if_infeasible = false) {
    std::vector<std::optional<size_t>> indices;
    if (scans.empty()) return indices;
    std::vector<Measurement> measurements;
    for (const Scan& scan : scans) measurements.push_back(scan.measurement);
    SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, run_.gain_model().FastCoverage(measurements));
    for (size_t i = 0; i < scans.size(); ++i) {
      ScanCoverage& c = coverage[i];
      const bool feasible = c.feasibility == ScanFeasibility::kFeasible;
      if (!feasible && !even_if_infeasible) {
        indices.push_back(std::nullopt);
        continue;
      }
      if (feasible) {
        scans[i].shares =
            run_.gain_model().ScoresPlans() ? std::move(c.shares) : FullShares(c.covered);
      }
      indices.push_back(pool_.Add(scans[i].shares));
      scans_.push_back(std::move(scans[i]));
    }
    return indices;
  }

  std::vector<Scan> ScansOf(const TopPoints& top) const {
    std::vector<Scan> scans;
    for (const auto& entry : top.entries()) {
      scans.push_back({entry.x, run_.space().ToMeasurement(entry.x), {}});
    }
    return scans;
  }

  absl::Status AddGivenScans() {
    for (const auto* given : {&run_.request().locked, &run_.request().starting}) {
      std::vector<Scan> scans;
      for (const Measurement& measurement : *given) {
        scans.push_back({run_.space().ToUnit(measurement), measurement, {}});
      }
      SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddToPool(std::move(scans), true));
      for (const auto& index : indices) plan_.push_back(*index);
    }
    std::vector<Scan> candidates;
    for (const Measurement& measurement : run_.request().candidates) {
      candidates.push_back({run_.space().ToUnit(measurement), measurement, {}});
    }
    return AddToPool(std::move(candidates)).status();
  }

  // Searches globally for scans of largest gain; the best different ones enter the pool. Returns
  // the index of the best, or nothing if no new scan was found.
  absl::StatusOr<std::optional<size_t>> SearchScan(const std::vector<float>& known,
                                                   int64_t evaluations, const std::string& phase) {
    // At most a tenth of the evaluations goes into coverage.
    const int64_t kept = std::clamp<int64_t>(evaluations / 10, 1, kKeptPerSearch);
    TopPoints top(static_cast<size_t>(kept), kKeptSeparation);
    MaximiseOptions options;
    options.periodic = run_.space().periodic();
    options.population = kSwarm;
    SIGHTLINE_RETURN_IF_ERROR(
        Maximise(Method::kParticleSwarm, run_.space().dimension(),
                 run_.Gain(known, &top, phase, static_cast<int64_t>(plan_.size())),
                 std::max<int64_t>(1, evaluations - kept), random_.Bits(), options)
            .status());
    SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddToPool(ScansOf(top)));
    if (indices.empty() || top.entries()[0].value <= 0) return std::nullopt;
    return indices[0];
  }

  absl::Status AddNextBest() {
    const std::vector<float> known = KnownFrom(plan_);
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto index,
        SearchScan(known, Share(kGreedyShare), absl::StrCat("searching scan ", plan_.size() + 1)));
    absl::StatusOr<double> added = 0.0;
    if (index) {
      added = run_.Added(known, scans_[*index].measurement, scans_[*index].shares);
      if (!added.ok()) return added.status();
    }
    if (!index || *added < run_.min_gain()) {
      if (++failures_ == 2) stalled_ = true;
      reason_ = StopReason::kStalled;
      return absl::OkStatus();
    }
    failures_ = 0;
    plan_.push_back(*index);
    return absl::OkStatus();
  }

  absl::Status CompletePlan() {
    while (Covered() < aim_ && !stalled_) {
      if (!RoomForMore()) {
        reason_ = StopReason::kMaxScans;
        break;
      }
      SIGHTLINE_RETURN_IF_ERROR(AddNextBest());
    }
    return absl::OkStatus();
  }

  // Exact score of the plan; scans that are infeasible by exact evaluation leave plan and pool.
  absl::StatusOr<PlanScore> ExactScore(bool thorough) {
    std::vector<Measurement> measurements;
    for (size_t scan : plan_) measurements.push_back(scans_[scan].measurement);
    SIGHTLINE_ASSIGN_OR_RETURN(auto exact, run_.Exact(measurements));
    PoolPlan feasible;
    std::vector<Measurement> kept;
    for (size_t i = 0; i < plan_.size(); ++i) {
      if (exact[i]->feasibility == ScanFeasibility::kFeasible) {
        feasible.push_back(plan_[i]);
        kept.push_back(measurements[i]);
      } else {
        scans_[plan_[i]].shares = {};
        pool_.Empty(plan_[i]);
      }
    }
    plan_ = std::move(feasible);
    return run_.Score(kept, thorough);
  }

  // Shifts the aim (targets by fast estimate) by the difference between fast and exact.
  void Aim(const PlanScore& score) {
    exact_covered_ = score.Claimed();
    aim_ = std::max<int64_t>(1, run_.goal_targets() + Covered() - score.Claimed());
  }

  absl::Status Calibrate() {
    SIGHTLINE_ASSIGN_OR_RETURN(auto score, ExactScore(false));
    Aim(score);
    return absl::OkStatus();
  }

  // The plan reaches the aim by the fast estimate; checks it exactly.
  absl::Status Verify() {
    const size_t size = plan_.size();
    SIGHTLINE_ASSIGN_OR_RETURN(auto score, ExactScore(false));
    Aim(score);
    if (run_.ReachesGoal(score)) {
      have_best_ = true;
      best_ = plan_;
      reached_.push_back(Movable());
      run_.Report("reached the goal", static_cast<int64_t>(plan_.size()), exact_covered_, true);
      return absl::OkStatus();
    }
    if (plan_.size() < size) pool_.CompleteGreedily(plan_, size, pool_.MostWorth());
    return absl::OkStatus();
  }

  // Removes the scan that adds least and compensates its loss from the pool. If the rest reaches
  // the aim it becomes the plan; otherwise it waits until the current plan is scored.
  bool FewerReach() {
    waiting_ = plan_;
    plan_.erase(plan_.begin() + static_cast<std::ptrdiff_t>(WeakestFirst().front()));
    ImproveFromPool();
    if (Covered() >= aim_) return true;
    std::swap(plan_, waiting_);
    return false;
  }

  void ImproveFromPool() {
    LimitPool();
    run_.Report(Phase("exchanging scans"), static_cast<int64_t>(plan_.size()), exact_covered_);
    const PoolPlan better = pool_.Anneal(plan_, fixed_, pool_.MostWorth(), kExchanges, random_,
                                         [this] { return run_.Stopped(); });
    // The pool uses only a sample of the targets, so compare over all targets.
    if (run_.Worth(KnownFrom(better)) >= run_.Worth(KnownFrom(plan_))) plan_ = better;
  }

  // Removes the scans that promise least for the current plan.
  void LimitPool() {
    if (pool_.size() <= kMaxPool) return;
    std::vector<double> promise = pool_.Promise(plan_);
    for (const PoolPlan* kept : {&plan_, &best_, &waiting_}) {
      for (size_t scan : *kept) promise[scan] = 2 * pool_.MostWorth() + 1;
    }
    std::vector<size_t> order(pool_.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return promise[a] > promise[b]; });
    order.resize(kMaxPool / 2);
    std::sort(order.begin(), order.end());
    std::vector<size_t> place_of(scans_.size());
    std::vector<Scan> scans;
    for (size_t scan : order) {
      place_of[scan] = scans.size();
      scans.push_back(std::move(scans_[scan]));
    }
    scans_ = std::move(scans);
    pool_.Keep(order);
    for (PoolPlan* kept : {&plan_, &best_, &waiting_}) {
      for (size_t& scan : *kept) scan = place_of[scan];
    }
  }

  std::vector<float> KnownFromOthers(size_t place) const {
    PoolPlan others = plan_;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(place));
    return KnownFrom(others);
  }

  // Positions of movable scans, the one that adds least to the others first.
  std::vector<size_t> WeakestFirst() const {
    std::vector<size_t> places;
    std::vector<double> added(plan_.size(), 0);
    for (size_t place = fixed_; place < plan_.size(); ++place) {
      places.push_back(place);
      added[place] = run_.GainAfter(KnownFromOthers(place), scans_[plan_[place]].shares);
    }
    std::stable_sort(places.begin(), places.end(),
                     [&](size_t a, size_t b) { return added[a] < added[b]; });
    return places;
  }

  // Moves every scan once to where it covers most of the targets that the others leave.
  absl::Status PolishRound() {
    for (size_t place : WeakestFirst()) {
      if (OutOfBudget() || Covered() >= aim_) break;
      SIGHTLINE_RETURN_IF_ERROR(Polish(place));
    }
    return absl::OkStatus();
  }

  // Local search (evolution strategy) around the scan.
  absl::Status Polish(size_t place) {
    const std::vector<float> others = KnownFromOthers(place);
    const int dimension = run_.space().dimension();
    if (dimension == 0) return absl::OkStatus();
    TopPoints top(kKeptPerPolish, 0.005);
    const BatchObjective objective =
        run_.Gain(others, &top, Phase("polishing"), static_cast<int64_t>(plan_.size()));
    std::vector<double> x = scans_[plan_[place]].x;
    double value = 0;
    if (run_.gain_model().ScoresPlans()) {
      SIGHTLINE_ASSIGN_OR_RETURN(auto own, objective(std::span(&x, 1)));
      value = own.front();
    } else {
      value = run_.GainAfter(others, scans_[plan_[place]].shares);
    }
    const double start_value = value;
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto climbed,
        Climb(
            std::move(x), value, PolishBatches(), objective,
            [this](std::span<const double> y) { return run_.space().Normalise(y); }, random_));
    std::vector<Scan> scans = ScansOf(top);
    if (climbed.moved) {
      scans.push_back({climbed.x, run_.space().ToMeasurement(climbed.x), {}});
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddToPool(std::move(scans)));
    if (climbed.moved && climbed.value >= start_value && indices.back()) {
      plan_[place] = *indices.back();
    }
    return absl::OkStatus();
  }

  // Replaces the weakest scan (after failures: the next weakest) by a new search.
  absl::Status RelocateWeakest(int failures) {
    const std::vector<size_t> places = WeakestFirst();
    if (places.empty() || OutOfBudget()) return absl::OkStatus();
    const size_t place = places[static_cast<size_t>(failures - 1) % places.size()];
    const std::vector<float> others = KnownFromOthers(place);
    SIGHTLINE_ASSIGN_OR_RETURN(auto index,
                               SearchScan(others, std::min(Left(), Share(kRelocateShare)),
                                          Phase("searching a scan anew")));
    if (index && run_.GainAfter(others, scans_[*index].shares) >=
                     run_.GainAfter(others, scans_[plan_[place]].shares)) {
      plan_[place] = *index;
    }
    return absl::OkStatus();
  }

  PlanRun& run_;
  const size_t fixed_;  // the first scans of a plan are locked
  Random random_;
  int64_t aim_;  // targets to satisfy by the fast estimate
  ScanPool pool_;
  std::vector<Scan> scans_;  // scans of the pool
  PoolPlan plan_;
  // State after each round with the present number of scans.
  struct Round {
    int64_t evaluations, covered;
  };
  std::vector<Round> rounds_;
  PoolPlan waiting_;                               // see FewerReach
  PoolPlan best_;                                  // the last plan whose score reached the goal
  std::vector<std::vector<Measurement>> reached_;  // all such plans, without their locked scans
  bool have_best_ = false;
  bool stalled_ = false;
  int failures_ = 0;
  int64_t exact_covered_ = 0;
  StopReason reason_ = StopReason::kStalled;
};

}  // namespace

absl::StatusOr<PlannerResult> PlanRefined(PlanRun& run) { return RefinedPlanner(run).Plan(); }

}  // namespace sightline
