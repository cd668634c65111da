// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/bounded_plan.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"
#include "planning/strategy/execution/least_time_plan.h"
#include "planning/strategy/generated_columns_plan.h"

namespace sightline {
namespace {

class BoundedSearch {
 public:
  BoundedSearch(GainModel& gain_model, const PlannerRequest& request, int64_t bound_evaluations,
                const BoundedPlanHooks& hooks)
      : gain_model_(gain_model),
        request_(request),
        bound_evaluations_(bound_evaluations),
        hooks_(hooks) {}

  absl::StatusOr<BoundedPlan> Run() {
    SIGHTLINE_RETURN_IF_ERROR(SearchFewest());
    if (!Interrupted() && WantsLeastTime(request_)) {
      SIGHTLINE_RETURN_IF_ERROR(PlanLeastTime());
    }
    return std::move(found_);
  }

 private:
  using Clock = std::chrono::steady_clock;

  static double SecondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  }

  bool Interrupted() const { return request_.interrupted != nullptr && *request_.interrupted; }

  // Runs `step` between its two callbacks.
  template <typename Step>
  auto During(PlanStep name, const Step& step) {
    if (hooks_.on_begin) hooks_.on_begin(name);
    const Clock::time_point start = Clock::now();
    auto result = step();
    const double seconds = SecondsSince(start);
    if (name == PlanStep::kPlan) draft_s_ = seconds;
    if (hooks_.on_end) hooks_.on_end(name, seconds);
    return result;
  }

  // The request with the time left after `used_s`; nothing if no time is left.
  std::optional<PlannerRequest> WithTimeLeft(double used_s) const {
    PlannerRequest request = request_;
    if (request.goal.max_time_s) {
      *request.goal.max_time_s -= used_s;
      if (*request.goal.max_time_s <= 0) return std::nullopt;
    }
    return request;
  }

  absl::Status Tell() { return hooks_.on_plan ? hooks_.on_plan(found_.plan) : absl::OkStatus(); }

  std::vector<Measurement> Scans() const {
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : found_.plan.scans) scans.push_back(scan.measurement);
    return scans;
  }

  absl::Status SearchFewest() {
    PlannerRequest request = request_;
    // A draft suffices, since the bound's scans improve it more than a longer search.
    request.draft = bound_evaluations_ > 0;
    SIGHTLINE_ASSIGN_OR_RETURN(
        found_.plan, During(PlanStep::kPlan, [&] { return MakePlan(gain_model_, request); }));
    SIGHTLINE_RETURN_IF_ERROR(Tell());
    if (bound_evaluations_ == 0 || Interrupted() || found_.plan.scans.empty()) {
      return absl::OkStatus();
    }
    SIGHTLINE_RETURN_IF_ERROR(FindBound());
    if (auto status = PlanAgain(); !status.ok() || Interrupted()) return status;
    if (found_.plan.stop_reason != StopReason::kGoalReached) return absl::OkStatus();
    return TakeIntoAccount(gain_model_, request_.domain, Scans(), *found_.bound);
  }

  // Bounds the number of scans for the fraction that the draft satisfies, limited by the goal.
  absl::Status FindBound() {
    const double satisfied =
        static_cast<double>(found_.plan.score.satisfied) /
        static_cast<double>(std::max<int64_t>(1, gain_model_.measurable().Count()));
    SIGHTLINE_ASSIGN_OR_RETURN(
        found_.bound, During(PlanStep::kBound, [&] {
          return BoundScanCount(
              gain_model_, request_.domain, std::min(GoalFraction(request_.goal), satisfied),
              Scans(), bound_evaluations_, request_.seed, hooks_.on_bound, request_.interrupted);
        }));
    return absl::OkStatus();
  }

  absl::Status PlanAgain() {
    const auto request = WithTimeLeft(draft_s_);
    if (!request || Interrupted()) return absl::OkStatus();
    const size_t before = found_.plan.scans.size();
    SIGHTLINE_ASSIGN_OR_RETURN(found_.plan, During(PlanStep::kPlanAgain, [&] {
                                 return PlanWithGeneratedColumns(
                                     gain_model_, *request, std::move(found_.plan), *found_.bound);
                               }));
    return found_.plan.scans.size() < before ? Tell() : absl::OkStatus();
  }

  absl::Status PlanLeastTime() {
    const auto request = WithTimeLeft(SecondsSince(start_));
    if (!request) return absl::OkStatus();
    std::vector<Measurement> good;
    if (found_.bound) good = found_.bound->generated_columns;
    SIGHTLINE_ASSIGN_OR_RETURN(found_.plan, During(PlanStep::kLeastTime, [&] {
                                 return PlanInLeastTime(gain_model_, *request,
                                                        std::move(found_.plan), good);
                               }));
    return Tell();
  }

  GainModel& gain_model_;
  const PlannerRequest& request_;
  const int64_t bound_evaluations_;
  const BoundedPlanHooks& hooks_;
  BoundedPlan found_;
  const Clock::time_point start_ = Clock::now();
  double draft_s_ = 0;
};

}  // namespace

absl::StatusOr<BoundedPlan> MakeBoundedPlan(GainModel& gain_model, const PlannerRequest& request,
                                            int64_t bound_evaluations,
                                            const BoundedPlanHooks& hooks) {
  return BoundedSearch(gain_model, request, bound_evaluations, hooks).Run();
}

}  // namespace sightline
