// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/make_pareto_front.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/random/random.h"
#include "core/status/status_macros.h"
#include "planning/pareto/timed_search.h"
#include "planning/strategy/plan_run.h"

namespace sightline {
namespace {

// Divisors of one plan's effort for a point of the front; its search starts from known plans.
constexpr int64_t kPointEffort = 4, kTimedEffort = 8;
// Extra scans beyond the plan for the goal: a quarter of its number, but at least this many.
constexpr int kFurtherScans = 2;
// Largest number of good scans, the newest ones, passed to the next point; more slow the choice.
constexpr size_t kCandidates = 800, kTimedCandidates = 1600;
constexpr int kMaxQuickerPlans = 8;
constexpr double kQuicker = 0.97;
// Progress at the end of each step.
constexpr double kPlanDone = 0.25, kCountsDone = 0.6, kTimesDone = 0.95;

class FrontMaker {
 public:
  FrontMaker(GainModel& gain_model, const ParetoRequest& request)
      : gain_model_(gain_model), request_(request), start_(std::chrono::steady_clock::now()) {}

  absl::StatusOr<ParetoResult> Make() {
    const int64_t evaluations_before = gain_model_.evaluations();
    SIGHTLINE_RETURN_IF_ERROR(AddPlanForGoal());
    absl::Status status = SweepCounts();
    if (status.ok() && !request_.execution.costs.IsUnit()) status = SweepTimes();
    if (!status.ok() && !Stopped()) return status;
    ParetoResult result;
    result.front = FrontOf(std::move(found_));
    result.evaluations = gain_model_.evaluations() - evaluations_before;
    result.plan_stop_reason = plan_stop_reason_;
    const auto chosen = PointForGoal(result.front.points);
    if (!chosen) return NothingSatisfied();
    result.stop_reason =
        result.front.points[*chosen].reaches_goal ? StopReason::kGoalReached : StopReason::kStalled;
    if (!status.ok() || Stopped()) {
      result.stop_reason = Interrupted() ? StopReason::kInterrupted : StopReason::kMaxTime;
    }
    return result;
  }

 private:
  bool Interrupted() const {
    return request_.plan.interrupted != nullptr && *request_.plan.interrupted;
  }
  std::optional<double> TimeLeftS() const {
    if (!request_.plan.goal.max_time_s) return std::nullopt;
    return *request_.plan.goal.max_time_s -
           std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  bool Stopped() const { return Interrupted() || TimeLeftS().value_or(1) <= 0; }

  absl::Status NothingSatisfied() const {
    if (Stopped()) return absl::CancelledError("stopped before there was a plan");
    if (gain_model_.measurable().Count() == 0) {
      return absl::FailedPreconditionError(
          "Pareto front: it is empty, because no measurable target has a tolerance");
    }
    return absl::FailedPreconditionError(absl::StrCat(
        "Pareto front: it is empty, because no feasible scan measures any of the ",
        gain_model_.measurable().Count(),
        " targets well enough; check whether the domain in `measurement`, the stage's travel or "
        "obstacles exclude all scans"));
  }

  // A request like the given one, with the remaining time.
  PlannerRequest Request(double from, double to, const std::string& what) {
    PlannerRequest plan = request_.plan;
    plan.with_curves = false;
    if (const auto left_s = TimeLeftS()) plan.goal.max_time_s = std::max(1e-9, *left_s);
    plan.on_progress = [this, from, to, what](const PlanProgress& p) {
      Progress(from + (to - from) * std::clamp(p.done, 0.0, 1.0),
               absl::StrCat(what, p.scans, " scans, ", absl::StrFormat("%.1f %%", 100 * p.coverage),
                            ": ", p.phase));
    };
    return plan;
  }

  void Progress(double fraction, const std::string& text) const {
    if (request_.on_progress) request_.on_progress(fraction, text);
  }

  // The plan as a point.
  void AddPoint(const PlannerResult& result) {
    if (result.scans.empty()) return;
    ParetoPoint point;
    point.scans = result.scans;
    point.score = result.score;
    std::vector<Measurement> scans;
    std::vector<FrameRange> frames;
    int locked = 0;
    for (const ChosenScan& scan : result.scans) {
      scans.push_back(scan.measurement);
      frames.push_back({scan.exact.first_frame, scan.exact.last_frame});
      locked += scan.locked ? 1 : 0;
    }
    point.time = TimeOfPlan(request_.execution, request_.scan_step_m, scans, frames, locked);
    point.reaches_goal = point.Claimed() >= goal_targets_;
    found_.push_back(std::move(point));
  }

  void AddCandidates(const std::vector<Measurement>& candidates) {
    for (const Measurement& candidate : candidates) {
      if (known_.insert(ToArray(candidate)).second) candidates_.push_back(candidate);
    }
  }

  std::span<const Measurement> Candidates(size_t most) const {
    return std::span(candidates_).last(std::min(most, candidates_.size()));
  }

  absl::Status AddPlanForGoal() {
    const PlannerRequest request = Request(0, kPlanDone, "");
    goal_targets_ = PlanRun(gain_model_, request).goal_targets();
    SIGHTLINE_ASSIGN_OR_RETURN(auto plan, MakePlan(gain_model_, request));
    if (plan.scans.empty()) return NothingSatisfied();
    plan_stop_reason_ = plan.stop_reason;
    AddPoint(plan);
    AddCandidates(plan.candidates);
    plan_scans_ = Movable(plan);
    return absl::OkStatus();
  }

  static std::vector<Measurement> Movable(const PlannerResult& plan) {
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : plan.scans) {
      if (!scan.locked) scans.push_back(scan.measurement);
    }
    return scans;
  }

  size_t locked() const { return request_.plan.locked.size(); }

  // The plan that satisfies most with this number of scans. `start`: as many scans or fewer,
  // without locked ones.
  absl::StatusOr<std::vector<Measurement>> MostWith(int scans, std::vector<Measurement> start,
                                                    double from, double to) {
    if (Stopped()) return absl::CancelledError("stopped");
    PlannerRequest request = Request(from, to, absl::StrCat("front, most with ", scans, ": "));
    request.scan_count = scans;
    request.starting = std::move(start);
    const auto candidates = Candidates(kCandidates);
    request.candidates.assign(candidates.begin(), candidates.end());
    // Evaluations of the candidates are granted in addition to those of the search.
    request.evaluations_per_scan =
        std::max<int64_t>(1, request.evaluations_per_scan / kPointEffort) +
        static_cast<int64_t>(candidates.size()) / scans;
    request.seed = static_cast<int64_t>(
        DeriveSeed(static_cast<uint64_t>(request.seed), 200 + static_cast<uint64_t>(scans)) >> 1);
    SIGHTLINE_ASSIGN_OR_RETURN(auto plan, MakePlan(gain_model_, request));
    AddPoint(plan);
    AddCandidates(plan.candidates);
    return Movable(plan);
  }

  absl::Status SweepCounts() {
    const auto base = static_cast<int>(locked() + plan_scans_.size());
    const int least = std::max(1, static_cast<int>(locked()));
    const int most = std::max(
        base, std::min(request_.plan.goal.max_scans, base + std::max(kFurtherScans, base / 4)));
    const double step = (kCountsDone - kPlanDone) / (most - least + 1);
    double done = kPlanDone;
    SIGHTLINE_ASSIGN_OR_RETURN(auto same, MostWith(base, plan_scans_, done, done + step));
    std::vector<Measurement> scans = same;
    for (int count = base - 1; count >= least; --count) {
      // The scan that adds least comes last in a plan.
      if (static_cast<int>(locked() + scans.size()) > count) {
        scans.resize(static_cast<size_t>(count) - locked());
      }
      done += step;
      SIGHTLINE_ASSIGN_OR_RETURN(scans, MostWith(count, scans, done, done + step));
    }
    scans = same;
    for (int count = base + 1; count <= most; ++count) {
      const int64_t before = found_.back().Claimed();
      done += step;
      SIGHTLINE_ASSIGN_OR_RETURN(auto more, MostWith(count, scans, done, done + step));
      if (count > base + 1 && found_.back().Claimed() <= before) break;
      scans = std::move(more);
    }
    return absl::OkStatus();
  }

  // The point so far that satisfies most within these limits of time and scans.
  const ParetoPoint* BestWithin(double limit_s, size_t limit_scans) const {
    const ParetoPoint* best = nullptr;
    for (const ParetoPoint& point : found_) {
      if (point.time.Total_s() > limit_s || point.scans.size() > limit_scans) continue;
      if (best == nullptr || point.Claimed() > best->Claimed() ||
          (point.Claimed() == best->Claimed() && point.time.Total_s() < best->time.Total_s())) {
        best = &point;
      }
    }
    return best;
  }
  // The quickest point that exceeds the time limit and keeps the limit of scans.
  const ParetoPoint* QuickestBeyond(double limit_s, size_t limit_scans) const {
    const ParetoPoint* best = nullptr;
    for (const ParetoPoint& point : found_) {
      if (point.time.Total_s() <= limit_s || point.scans.size() > limit_scans) continue;
      if (best == nullptr || point.time.Total_s() < best->time.Total_s()) best = &point;
    }
    return best;
  }
  const ParetoPoint* QuickestForGoal() const {
    const ParetoPoint* best = nullptr;
    for (const ParetoPoint& point : found_) {
      if (!point.reaches_goal) continue;
      if (best == nullptr || point.time.Total_s() < best->time.Total_s()) best = &point;
    }
    return best;
  }

  static std::vector<Measurement> Movable(const ParetoPoint& point) {
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : point.scans) {
      if (!scan.locked) scans.push_back(scan.measurement);
    }
    return scans;
  }

  // Number of scans of the point that satisfies most within the limit; 0 if there is none.
  size_t MostSatisfiedScans(double limit_s) const {
    const ParetoPoint* best = BestWithin(limit_s, MostScans());
    return best == nullptr ? 0 : best->scans.size();
  }
  // True if the plan that satisfies most with this number of scans keeps the time limit.
  bool HasPlanWithin(size_t scans, double limit_s) const {
    const ParetoPoint* best = BestWithin(std::numeric_limits<double>::infinity(), scans);
    return best != nullptr && best->time.Total_s() <= limit_s;
  }

  // Adds the plan that satisfies most within limits of seconds and scans,
  // if there is one. Without `search_scans` it chooses from known scans
  // only.
  absl::Status AddWithin(TimedSearch& search, PlanRun& run, double limit_s, size_t limit_scans,
                         bool search_scans) {
    if (Stopped()) return absl::CancelledError("stopped");
    // Starts: the best plan that fits, and the quickest longer plan, which is shortened.
    std::vector<std::vector<Measurement>> starts;
    size_t most_scans = 1;
    for (const ParetoPoint* point :
         {BestWithin(limit_s, limit_scans), QuickestBeyond(limit_s, limit_scans)}) {
      if (point == nullptr) continue;
      starts.push_back(Movable(*point));
      most_scans = std::max(most_scans, point->scans.size());
    }
    const int64_t effort =
        search_scans ? std::max<int64_t>(1, request_.plan.evaluations_per_scan / kTimedEffort) *
                           static_cast<int64_t>(most_scans)
                     : 0;
    auto scans = search.MostWithin(limit_s, starts, limit_scans, effort);
    if (!scans.ok()) {
      return run.Stopped() ? absl::CancelledError("stopped") : scans.status();
    }
    if (scans->empty() && locked() == 0) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(auto plan, run.Finish(*scans, StopReason::kStalled));
    AddPoint(plan);
    return absl::OkStatus();
  }

  size_t MostScans() const { return static_cast<size_t>(request_.plan.goal.max_scans); }

  absl::Status SweepTimes() {
    double longest_s = 0;
    for (const ParetoPoint& point : found_) longest_s = std::max(longest_s, point.time.Total_s());
    // No scan takes time, so there is nothing to limit.
    if (longest_s <= 0) return absl::OkStatus();
    std::string where;
    double fraction = kCountsDone;
    PlannerRequest request = Request(kCountsDone, 1, "");
    request.on_progress = [&](const PlanProgress& p) {
      Progress(fraction, absl::StrCat(where, p.scans, " scans, ",
                                      absl::StrFormat("%.1f %%", 100 * p.coverage), ": ", p.phase));
    };
    PlanRun run(gain_model_, request);
    TimedSearch search(run, request_.execution, request_.scan_step_m, request_.estimate_frames);
    std::vector<Measurement> known;
    for (const ParetoPoint& point : found_) {
      for (const Measurement& scan : Movable(point)) known.push_back(scan);
    }
    const auto candidates = Candidates(kTimedCandidates);
    known.insert(known.end(), candidates.begin(), candidates.end());
    SIGHTLINE_RETURN_IF_ERROR(search.Start(known));

    for (int i = request_.time_limits; i >= 1; --i) {
      const double limit_s = longest_s * i / request_.time_limits;
      fraction = kCountsDone +
                 (kTimesDone - kCountsDone) * (request_.time_limits - i) / request_.time_limits;
      where = absl::StrFormat("front, most within %.1f s: ", limit_s);
      SIGHTLINE_RETURN_IF_ERROR(AddWithin(search, run, limit_s, MostScans(), true));
      // Fewer scans in the same time, unless the plan with so many scans fits anyway.
      const size_t least = MostSatisfiedScans(limit_s);
      for (size_t count = std::max<size_t>(1, least) - 1; count > locked(); --count) {
        if (HasPlanWithin(count, limit_s)) break;
        where = absl::StrFormat("front, most with %d within %.1f s: ", count, limit_s);
        SIGHTLINE_RETURN_IF_ERROR(AddWithin(search, run, limit_s, count, false));
      }
    }
    fraction = kTimesDone;
    for (int i = 0; i < kMaxQuickerPlans; ++i) {
      const ParetoPoint* quickest = QuickestForGoal();
      if (quickest == nullptr) break;
      const double before_s = quickest->time.Total_s();
      where = absl::StrFormat("front, the goal in less than %.1f s: ", before_s);
      SIGHTLINE_RETURN_IF_ERROR(AddWithin(search, run, kQuicker * before_s, MostScans(), true));
      if (!found_.back().reaches_goal) break;
    }
    return absl::OkStatus();
  }

  GainModel& gain_model_;
  const ParetoRequest& request_;
  const std::chrono::steady_clock::time_point start_;
  int64_t goal_targets_ = 0;
  StopReason plan_stop_reason_ = StopReason::kStalled;
  std::vector<ParetoPoint> found_;
  std::vector<Measurement> plan_scans_;  // of the plan for the goal, without locked scans
  std::vector<Measurement> candidates_;
  std::set<std::array<double, kMeasurementParameters>> known_;
};

}  // namespace

absl::StatusOr<ParetoResult> MakeParetoFront(GainModel& gain_model, const ParetoRequest& request) {
  if (request.plan.strategy != "refined") {
    return absl::InvalidArgumentError(absl::StrCat("strategy: \"", request.plan.strategy,
                                                   "\" makes no Pareto front, only \"refined\""));
  }
  if (request.time_limits < 0 || request.time_limits > 1000) {
    return absl::InvalidArgumentError(
        absl::StrCat("time_limits: ", request.time_limits, " is not in [0, 1000]"));
  }
  return FrontMaker(gain_model, request).Make();
}

}  // namespace sightline
