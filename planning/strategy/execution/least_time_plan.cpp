// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/least_time_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/random/random.h"
#include "core/status/status_macros.h"
#include "planning/optimise/climb.h"
#include "planning/optimise/maximise.h"
#include "planning/strategy/execution/setup_choice.h"
#include "planning/strategy/plan_run.h"
#include "planning/strategy/pool/scan_pool.h"
#include "planning/strategy/scan_order.h"

namespace sightline {
namespace {

constexpr double kNever_s = std::numeric_limits<double>::infinity();
constexpr size_t kChoicePairs = 16384;
constexpr size_t kMostWays = 24;        // poses of the part in the plan's scans
constexpr size_t kMostCandidates = 96;  // scans of earlier searches
constexpr size_t kTriedPlaces = 40, kSearchedPlaces = 12;
constexpr int kScansPerPlace = 5;
constexpr size_t kKeptAtPlace = 6;
constexpr double kSeparationAtPlace = 0.03;
constexpr int kChoiceRounds = 250;
constexpr int kSwarmAtPlace = 24;
// Fractions of the evaluations.
constexpr double kSearchShare = 0.5;
constexpr int64_t kPlaceTrials = 24;
constexpr size_t kMostPool = 3000;
constexpr int kMostChecks = 4;  // exact scores of whole plans

// Parameters fixed while the sensors stay in place, and those fixed while the part does.
constexpr std::array kPlaceParameters = {kCameraDistance, kTriangulationAngle, kCameraAzimuth,
                                         kCameraPolar};
constexpr std::array kPartParameters = {kPartAlpha, kPartBeta, kPartGamma, kOffsetY, kOffsetZ};

template <size_t N>
MeasurementDomain WithFixed(MeasurementDomain domain,
                            const std::array<MeasurementParameter, N>& parameters,
                            const Measurement& at) {
  const auto values = ToArray(at);
  for (const MeasurementParameter p : parameters) {
    domain.parameters[p].ranges.clear();
    domain.parameters[p].values = {values[p]};
  }
  return domain;
}

struct PooledScan {
  Measurement measurement;
  TargetShares shares;  // fast
};

class LeastTimePlanner {
 public:
  LeastTimePlanner(PlanRun& run, const PlannerResult& plan, std::span<const Measurement> candidates)
      : run_(run),
        model_(run.request().execution),
        given_(plan),
        candidates_(candidates),
        random_(DeriveSeed(static_cast<uint64_t>(run.request().seed), 57)),
        pool_(run.gain_model().steps(),
              TargetSample(run.gain_model().measurable(), run.gain_model().steps().size(),
                           kChoicePairs, random_)) {
    for (const ChosenScan& scan : plan.scans) fixed_ += scan.locked ? 1 : 0;
    const auto scans = static_cast<double>(std::max<size_t>(4, plan.scans.size()));
    budget_ = static_cast<int64_t>(kLeastTimeShare * scans *
                                   static_cast<double>(run.request().evaluations_per_scan));
    limits_.scans = static_cast<size_t>(run.request().goal.max_scans);
    if (!run.request().goal.LimitsExecution()) {
      limits_.scans = std::min(limits_.scans, plan.scans.size() + 1);
    }
    limits_.scans = std::max(limits_.scans, fixed_);
    const PlanningGoal& goal = run.request().goal;
    limits_.time_s = goal.execution_time_s;
    limits_.setups = goal.max_setups;
    limits_.places = goal.max_sensor_places;
    limits_.rests = goal.max_resting_faces;
  }

  // Scans of the best accepted plan without the locked ones; nothing if none improves the given
  // one.
  absl::StatusOr<std::optional<std::vector<Measurement>>> Plan() {
    absl::Status status = Search();
    if (!status.ok() && !run_.IsStop(status)) return status;
    return best_;
  }
  // True if the given plan keeps the limits.
  bool given_keeps_limits() const { return given_keeps_limits_; }

 private:
  absl::Status Search() {
    SIGHTLINE_RETURN_IF_ERROR(AddPlan());
    SIGHTLINE_RETURN_IF_ERROR(FillPool());
    SIGHTLINE_RETURN_IF_ERROR(SearchPlaces());
    int rounds_without_progress = 0;
    while (rounds_without_progress < 2) {
      const double before_s = best_time_s_;
      Choose();
      SIGHTLINE_RETURN_IF_ERROR(Check());
      rounds_without_progress = best_time_s_ < before_s - 1 ? 0 : rounds_without_progress + 1;
      if (OutOfBudget()) break;
      SIGHTLINE_RETURN_IF_ERROR(PolishScans());
      SIGHTLINE_RETURN_IF_ERROR(PolishPlaces());
    }
    return absl::OkStatus();
  }

  bool OutOfBudget() const { return run_.evaluations() >= budget_; }

  void Report() {
    run_.Report("fewer set-ups", static_cast<int64_t>(plan_.size()), given_.score.satisfied);
  }

  size_t NumberOf(std::vector<Measurement>& known, const Measurement& m,
                  bool (*same)(const ExecutionModel&, const Measurement&, const Measurement&)) {
    const auto found = std::find_if(known.begin(), known.end(), [&](const Measurement& other) {
      return same(model_, other, m);
    });
    const auto index = static_cast<size_t>(found - known.begin());
    if (found == known.end()) known.push_back(m);
    return index;
  }

  // Adds feasible scans to the pool; returns their indices, nothing for infeasible ones.
  absl::StatusOr<std::vector<std::optional<size_t>>> AddToPool(
      const std::vector<Measurement>& measurements, bool even_if_infeasible = false) {
    std::vector<std::optional<size_t>> indices;
    constexpr size_t kBatch = 256;
    for (size_t begin = 0; begin < measurements.size(); begin += kBatch) {
      if (run_.Stopped()) return absl::CancelledError("planning was stopped");
      const size_t count = std::min(kBatch, measurements.size() - begin);
      const std::span<const Measurement> batch(measurements.data() + begin, count);
      SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, run_.gain_model().FastCoverage(batch));
      for (size_t i = 0; i < count; ++i) {
        ScanCoverage& c = coverage[i];
        const bool feasible = c.feasibility == ScanFeasibility::kFeasible;
        if ((!feasible && !even_if_infeasible) || scans_.size() >= kMostPool) {
          indices.push_back(std::nullopt);
          continue;
        }
        TargetShares shares;
        if (feasible) {
          shares = run_.gain_model().ScoresPlans() ? std::move(c.shares) : FullShares(c.covered);
        }
        const Measurement& m = batch[i];
        setup_.push_back({NumberOf(places_, m, SamePlaceOfSensors), NumberOf(rests_, m, SameRest),
                          run_.request().scan_time_s ? run_.request().scan_time_s(m) : 0});
        indices.push_back(pool_.Add(shares));
        scans_.push_back({m, std::move(shares)});
      }
      Report();
    }
    return indices;
  }

  // Adds the given plan: start of the search, and the worth that a plan must reach.
  absl::Status AddPlan() {
    std::vector<Measurement> measurements;
    for (const bool locked : {true, false}) {
      for (const ChosenScan& scan : given_.scans) {
        if (scan.locked == locked) measurements.push_back(scan.measurement);
      }
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddToPool(measurements, true));
    for (const auto& index : indices) plan_.push_back(*index);
    // A plan need not keep the given plan's surplus over the goal.
    const double spare =
        std::max<double>(0, static_cast<double>(given_.score.Claimed() - run_.goal_targets()));
    const double pooled = pool_.Worth(plan_);
    const double part = spare / static_cast<double>(std::max<int64_t>(1, given_.score.Claimed()));
    aim_ = pooled * (1 - part);
    needed_ = std::min(run_.goal_targets(), given_.score.Claimed());
    std::vector<const ScanCoverage*> exact;
    for (const ChosenScan& scan : given_.scans) exact.push_back(&scan.exact);
    given_keeps_limits_ = Choice().KeepsLimits(plan_) &&
                          TimeByFramesS(measurements, exact) <= limits_.time_s.value_or(kNever_s);
    if (given_keeps_limits_) {
      best_time_s_ = EstimatedTimeS(measurements);
      best_satisfied_ = needed_;
    }
    return absl::OkStatus();
  }

  SetupChoice Choice() const { return SetupChoice(pool_, setup_, model_.costs, limits_); }

  // Set-up and moves between scans, in the best order.
  double MovingTimeS(const std::vector<Measurement>& scans) const {
    return (scans.empty() ? 0 : TimesBeforeFirst(model_).Total_s()) +
           TotalRepositionTimeS(model_, scans, OrderScans(model_, scans, static_cast<int>(fixed_)));
  }

  double EstimatedTimeS(const std::vector<Measurement>& scans) const {
    double time_s = MovingTimeS(scans);
    for (const Measurement& scan : scans) {
      if (run_.request().scan_time_s) time_s += run_.request().scan_time_s(scan);
    }
    return time_s;
  }

  double TimeByFramesS(const std::vector<Measurement>& scans,
                       const std::vector<const ScanCoverage*>& exact) const {
    double time_s = MovingTimeS(scans);
    for (const ScanCoverage* scan : exact) {
      time_s += ScanTimeS(model_.costs, model_.scan_step_m, scan->first_frame, scan->last_frame);
    }
    return time_s;
  }

  std::vector<float> KnownFrom(const PoolPlan& plan) const {
    std::vector<float> known = run_.NothingKnown();
    for (const size_t scan : plan) AddShares(scans_[scan].shares, known);
    return known;
  }

  // Combines every place with every pose that the part has in the plan.
  absl::Status FillPool() {
    std::vector<Measurement> ways, places;
    for (const ChosenScan& scan : given_.scans) {
      if (ways.size() < kMostWays) ways.push_back(scan.measurement);
      NumberOf(places, scan.measurement, SamePlaceOfSensors);
    }
    std::vector<Measurement> others;
    const size_t stride = candidates_.size() / kMostCandidates + 1;
    for (size_t i = 0; i < candidates_.size(); i += stride) others.push_back(candidates_[i]);
    SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddToPool(others));
    std::vector<size_t> order(others.size());
    std::iota(order.begin(), order.end(), size_t{0});
    const auto settles = [&](size_t i) {
      return indices[i] ? scans_[*indices[i]].shares.targets.size() : 0;
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return settles(a) > settles(b); });
    for (const size_t i : order) {
      if (places.size() >= kTriedPlaces) break;
      if (settles(i) > 0) NumberOf(places, others[i], SamePlaceOfSensors);
    }
    if (places.size() > kTriedPlaces) places.resize(kTriedPlaces);
    std::vector<Measurement> tried;
    for (const Measurement& place : places) {
      for (const Measurement& way : ways) {
        const Measurement scan = AtPlaceOf(model_, place, way);
        if (run_.request().domain.Contains(scan)) tried.push_back(scan);
      }
    }
    return AddToPool(tried).status();
  }

  // Numbers of the places whose scans in the pool together satisfy most, best first.
  std::vector<size_t> BestPlaces() const {
    std::map<size_t, PoolPlan> of_place;
    for (size_t scan = 0; scan < scans_.size(); ++scan)
      of_place[setup_[scan].place].push_back(scan);
    std::vector<std::pair<double, size_t>> worth;
    for (const auto& [place, scans] : of_place) worth.push_back({-pool_.Worth(scans), place});
    std::sort(worth.begin(), worth.end());
    std::vector<size_t> best;
    for (const auto& [negative_worth, place] : worth) {
      if (best.size() < kSearchedPlaces) best.push_back(place);
    }
    return best;
  }

  // Searches scans that complement one another, for each of the best places.
  absl::Status SearchPlaces() {
    const std::vector<size_t> best = BestPlaces();
    if (best.empty()) return absl::OkStatus();
    const int64_t left = std::max<int64_t>(
        0, static_cast<int64_t>(kSearchShare * static_cast<double>(budget_)) - run_.evaluations());
    const int64_t each = left / static_cast<int64_t>(best.size()) / kScansPerPlace;
    if (each < kSwarmAtPlace) return absl::OkStatus();
    for (const size_t place : best) {
      std::vector<float> known = run_.NothingKnown();
      for (int i = 0; i < kScansPerPlace; ++i) {
        SIGHTLINE_ASSIGN_OR_RETURN(auto found, SearchScan(places_[place], known, each));
        if (!found) break;
        AddShares(scans_[*found].shares, known);
      }
    }
    return absl::OkStatus();
  }

  // Fast gains of points of `space` made from the place; the best enter `top`.
  BatchObjective GainAt(const SearchSpace& space, const Measurement& place,
                        const std::vector<float>& known, TopPoints* top) {
    return [this, &space, &place, &known, top](
               std::span<const std::vector<double>> points) -> absl::StatusOr<std::vector<double>> {
      if (run_.Stopped()) return absl::CancelledError("planning was stopped");
      std::vector<Measurement> measurements;
      for (const auto& x : points) {
        measurements.push_back(AtPlaceOf(model_, place, space.ToMeasurement(x)));
      }
      SIGHTLINE_ASSIGN_OR_RETURN(auto gains, run_.gain_model().Gains(measurements, known));
      std::vector<double> values;
      for (size_t i = 0; i < gains.size(); ++i) {
        const ScanGain& gain = gains[i];
        // With another resting face the height of a place may lie outside the domain.
        const bool possible = gain.feasibility == ScanFeasibility::kFeasible &&
                              run_.request().domain.Contains(measurements[i]);
        values.push_back(possible ? gain.gain : -1);
        if (values.back() > 0) top->Add(space.Normalise(points[i]), values.back());
      }
      Report();
      return values;
    };
  }

  absl::StatusOr<std::vector<std::optional<size_t>>> AddTop(const SearchSpace& space,
                                                            const Measurement& place,
                                                            const TopPoints& top) {
    std::vector<Measurement> scans;
    for (const auto& entry : top.entries()) {
      scans.push_back(AtPlaceOf(model_, place, space.ToMeasurement(entry.x)));
    }
    return AddToPool(scans);
  }

  SearchSpace SpaceAt(const Measurement& place) const {
    const MeasurementDomain& domain = run_.request().domain;
    if (!model_.robot_holds_head) return SearchSpace(WithFixed(domain, kPlaceParameters, place));
    return SearchSpace(WithFixed(domain, std::array{kCameraDistance, kTriangulationAngle}, place));
  }

  // The scan of largest gain from this place; nothing if no scan has a gain.
  absl::StatusOr<std::optional<size_t>> SearchScan(const Measurement place,
                                                   const std::vector<float>& known,
                                                   int64_t evaluations) {
    const SearchSpace space = SpaceAt(place);
    TopPoints top(kKeptAtPlace, kSeparationAtPlace);
    MaximiseOptions options;
    options.periodic = space.periodic();
    options.population = kSwarmAtPlace;
    SIGHTLINE_RETURN_IF_ERROR(Maximise(Method::kParticleSwarm, space.dimension(),
                                       GainAt(space, place, known, &top), evaluations,
                                       random_.Bits(), options)
                                  .status());
    SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddTop(space, place, top));
    if (indices.empty()) return std::nullopt;
    return indices.front();
  }

  void Choose() {
    Report();
    plan_ = Choice().Improve(std::move(plan_), fixed_, aim_, kChoiceRounds, random_,
                             [this] { return run_.Stopped(); });
  }

  std::vector<Measurement> Measurements(const PoolPlan& plan) const {
    std::vector<Measurement> scans;
    for (const size_t scan : plan) scans.push_back(scans_[scan].measurement);
    return scans;
  }

  // Scores the plan exactly; if it satisfies too little, raises the aim.
  absl::Status Check() {
    for (int check = 0; check < kMostChecks; ++check) {
      std::vector<Measurement> scans = Measurements(plan_);
      const double time_s = EstimatedTimeS(scans);
      const bool limited = run_.request().goal.LimitsExecution();
      if (!limited && time_s >= best_time_s_ - 1) return absl::OkStatus();
      SIGHTLINE_ASSIGN_OR_RETURN(auto exact, run_.Exact(scans));
      bool feasible = true;
      for (size_t i = fixed_; i < plan_.size(); ++i) {
        if (exact[i]->feasibility == ScanFeasibility::kFeasible) continue;
        feasible = false;
        scans_[plan_[i]].shares = {};
        pool_.Empty(plan_[i]);
      }
      const double over_s =
          limits_.time_s ? TimeByFramesS(scans, exact) - *run_.request().goal.execution_time_s : 0;
      if (feasible && over_s > 0) {
        // Estimates of scan times were too low: tighten the limit by the excess.
        *limits_.time_s -= over_s + 1e-6;
      } else if (feasible) {
        SIGHTLINE_ASSIGN_OR_RETURN(auto score, run_.Score(scans, true));
        const int64_t satisfied = std::min(score.Claimed(), needed_);
        if (satisfied > best_satisfied_ ||
            (satisfied == best_satisfied_ && time_s < best_time_s_)) {
          if (satisfied >= needed_ || limited) {
            best_ = std::vector<Measurement>(scans.begin() + static_cast<std::ptrdiff_t>(fixed_),
                                             scans.end());
            best_time_s_ = time_s;
            best_satisfied_ = satisfied;
          }
        }
        if (satisfied >= needed_) return absl::OkStatus();
        // Raise the aim by the worth of the missing targets.
        aim_ *= 1 + 1.02 * static_cast<double>(needed_ - satisfied) /
                        static_cast<double>(std::max<int64_t>(1, satisfied));
        aim_ = std::min(aim_, pool_.MostWorth());
      }
      Choose();
    }
    return absl::OkStatus();
  }

  // Moves every scan once, from a fixed place, to where it adds most to the others.
  absl::Status PolishScans() {
    for (size_t i = fixed_; i < plan_.size() && !OutOfBudget(); ++i) {
      PoolPlan others = plan_;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      const std::vector<float> known = KnownFrom(others);
      const Measurement place = scans_[plan_[i]].measurement;
      const SearchSpace space = SpaceAt(place);
      if (space.dimension() == 0) continue;
      TopPoints top(kKeptAtPlace, 0.005);
      const BatchObjective objective = GainAt(space, place, known, &top);
      std::vector<double> x = space.ToUnit(place);
      SIGHTLINE_ASSIGN_OR_RETURN(auto own, objective(std::span(&x, 1)));
      SIGHTLINE_ASSIGN_OR_RETURN(
          auto climbed,
          Climb(
              x, own.front(), 2, objective,
              [&](std::span<const double> y) { return space.Normalise(y); }, random_));
      SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddTop(space, place, top));
      if (climbed.value > own.front() && !indices.empty() && indices.front()) {
        plan_[i] = *indices.front();
      }
    }
    return absl::OkStatus();
  }

  // Moves every place of the sensors once, together with all its scans.
  absl::Status PolishPlaces() {
    std::set<size_t> places;
    for (size_t i = fixed_; i < plan_.size(); ++i) places.insert(setup_[plan_[i]].place);
    for (size_t i = 0; i < fixed_; ++i) places.erase(setup_[plan_[i]].place);
    for (const size_t place : places) {
      if (OutOfBudget()) break;
      SIGHTLINE_RETURN_IF_ERROR(PolishPlace(place));
    }
    return absl::OkStatus();
  }

  absl::Status PolishPlace(size_t place) {
    std::vector<size_t> of_place;  // positions in the plan of this place's scans
    PoolPlan others;
    for (size_t i = 0; i < plan_.size(); ++i) {
      if (setup_[plan_[i]].place == place) {
        of_place.push_back(i);
      } else {
        others.push_back(plan_[i]);
      }
    }
    const Measurement at = places_[place];
    const SearchSpace space(WithFixed(FreeOfRests(), kPartParameters, at));
    if (space.dimension() == 0) return absl::OkStatus();
    const std::vector<double> x = space.ToUnit(at);
    PoolPlan best = plan_;
    double best_worth = pool_.Worth(plan_);
    for (int64_t trial = 0; trial < kPlaceTrials; ++trial) {
      std::vector<double> y = x;
      const double step = 0.05 * std::exp(random_.Normal());
      for (double& coordinate : y) coordinate += step * random_.Normal();
      const Measurement moved = space.ToMeasurement(y);
      std::vector<Measurement> scans;
      for (const size_t i : of_place) {
        Measurement scan = AtPlaceOf(model_, moved, scans_[plan_[i]].measurement);
        // A moved place keeps its height.
        scan.offset_z_m = scans_[plan_[i]].measurement.offset_z_m;
        scans.push_back(scan);
      }
      SIGHTLINE_ASSIGN_OR_RETURN(auto indices, AddToPool(scans));
      PoolPlan with = plan_;
      bool all = true;
      for (size_t k = 0; k < of_place.size(); ++k) {
        all = all && indices[k].has_value();
        if (all) with[of_place[k]] = *indices[k];
      }
      if (!all) continue;
      if (const double worth = pool_.Worth(with); worth > best_worth) {
        best_worth = worth;
        best = std::move(with);
      }
    }
    plan_ = std::move(best);
    return absl::OkStatus();
  }

  // The domain without resting orientations, which take one coordinate of their own.
  MeasurementDomain FreeOfRests() const {
    MeasurementDomain domain = run_.request().domain;
    domain.resting_orientations.clear();
    return domain;
  }

  PlanRun& run_;
  const ExecutionModel& model_;
  const PlannerResult& given_;
  const std::span<const Measurement> candidates_;
  size_t fixed_ = 0;  // the first scans of a plan are locked
  Random random_;
  ScanPool pool_;
  std::vector<PooledScan> scans_;   // scans of the pool
  std::vector<SetupOfScan> setup_;  // of each scan in scans_
  std::vector<Measurement> places_, rests_;
  SetupLimits limits_;
  int64_t budget_ = 0;
  PoolPlan plan_;
  double aim_ = 0;      // worth, by the fast estimate
  int64_t needed_ = 0;  // targets to satisfy, exactly
  std::optional<std::vector<Measurement>> best_;
  double best_time_s_ = kNever_s;
  int64_t best_satisfied_ = -1;  // -1: no plan yet that keeps the limits
  bool given_keeps_limits_ = false;
};

}  // namespace

bool WantsLeastTime(const PlannerRequest& request) {
  return request.execution.costs.PricesSetups() || request.goal.LimitsExecution();
}

absl::StatusOr<PlannerResult> PlanInLeastTime(GainModel& gain_model, const PlannerRequest& request,
                                              PlannerResult plan,
                                              std::span<const Measurement> candidates) {
  if (!WantsLeastTime(request) || plan.scans.empty() ||
      plan.stop_reason == StopReason::kInterrupted) {
    return plan;
  }
  PlannerRequest again = request;
  again.locked.clear();
  again.starting.clear();
  for (const ChosenScan& scan : plan.scans) {
    if (scan.locked) again.locked.push_back(scan.measurement);
  }
  std::vector<Measurement> good(candidates.begin(), candidates.end());
  good.insert(good.end(), plan.candidates.begin(), plan.candidates.end());
  PlanRun run(gain_model, again);
  LeastTimePlanner planner(run, plan, good);
  SIGHTLINE_ASSIGN_OR_RETURN(auto found, planner.Plan());
  const int64_t before = plan.evaluations;
  if (found) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto finished, run.Finish(*found, plan.stop_reason));
    if (run.Stopped()) {
      finished.stop_reason = run.stopped_reason();
    } else if (run.ReachesGoal(finished.score)) {
      finished.stop_reason = StopReason::kGoalReached;
    } else if (request.goal.LimitsExecution()) {
      finished.stop_reason = StopReason::kExecutionLimit;
    }
    plan = std::move(finished);
  } else if (request.goal.LimitsExecution() && !planner.given_keeps_limits()) {
    plan.stop_reason = run.Stopped() ? run.stopped_reason() : StopReason::kExecutionLimit;
  }
  plan.evaluations = before + run.evaluations();
  return plan;
}

}  // namespace sightline
