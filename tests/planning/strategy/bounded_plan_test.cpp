// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/bounded_plan.h"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

#include "planning/strategy/scan_order.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

constexpr int64_t kBoundEvaluations = 20000;

PlannerRequest Request(int64_t seed) {
  PlannerRequest request;
  request.domain = NineParameterDomain();
  request.goal.coverage = 0.9;
  request.evaluations_per_scan = 400;
  request.seed = seed;
  return request;
}

PlannerRequest RequestByHand(int64_t seed) {
  PlannerRequest request = Request(seed);
  request.execution.costs.lay_time_s = 180;
  request.execution.costs.turn_time_s = 60;
  request.execution.costs.move_sensors_time_s = 900;
  return request;
}

double TimeOf(const PlannerRequest& request, const PlannerResult& plan) {
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : plan.scans) scans.push_back(scan.measurement);
  return TotalRepositionTimeS(request.execution, scans, OrderScans(request.execution, scans));
}

TEST(BoundedPlanTest, TellsEveryPlanAndEachReplacesTheOneBefore) {
  for (int64_t seed = 1; seed <= 3; ++seed) {
    FunctionGainModel gain_model = CastingGainModel(300, static_cast<uint64_t>(seed));
    const PlannerRequest request = RequestByHand(seed);
    std::vector<PlanStep> begun, ended;
    std::vector<PlannerResult> plans;
    BoundedPlanHooks hooks;
    hooks.on_begin = [&](PlanStep step) { begun.push_back(step); };
    hooks.on_end = [&](PlanStep step, double) { ended.push_back(step); };
    hooks.on_plan = [&](const PlannerResult& plan) {
      plans.push_back(plan);
      return absl::OkStatus();
    };
    const auto found = MakeBoundedPlan(gain_model, request, kBoundEvaluations, hooks);
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_EQ(begun, (std::vector<PlanStep>{PlanStep::kPlan, PlanStep::kBound, PlanStep::kPlanAgain,
                                            PlanStep::kLeastTime}));
    EXPECT_EQ(ended, begun);
    ASSERT_GE(plans.size(), 2U);
    for (const PlannerResult& plan : plans) EXPECT_GE(plan.score.Claimed(), 270);
    EXPECT_EQ(plans.back().scans.size(), found->plan.scans.size());
    EXPECT_LE(TimeOf(request, found->plan), TimeOf(request, plans.front()));
    ASSERT_TRUE(found->bound.has_value());
    EXPECT_LE(found->bound->bound, static_cast<double>(found->plan.scans.size()) + 1e-6);
  }
}

TEST(BoundedPlanTest, PlansOnceWithoutABound) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  const auto found = MakeBoundedPlan(gain_model, Request(1), 0);
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_FALSE(found->bound.has_value());
  FunctionGainModel other = CastingGainModel(300, 1);
  const auto plan = MakePlan(other, Request(1));
  ASSERT_TRUE(plan.ok());
  ASSERT_EQ(found->plan.scans.size(), plan->scans.size());
  for (size_t i = 0; i < plan->scans.size(); ++i) {
    EXPECT_EQ(found->plan.scans[i].measurement, plan->scans[i].measurement);
  }
}

TEST(BoundedPlanTest, AnInterruptionKeepsThePlanSoFar) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  std::atomic<bool> interrupted = false;
  PlannerRequest request = RequestByHand(1);
  request.interrupted = &interrupted;
  BoundedPlanHooks hooks;
  hooks.on_plan = [&](const PlannerResult&) {
    interrupted = true;
    return absl::OkStatus();
  };
  const auto found = MakeBoundedPlan(gain_model, request, kBoundEvaluations, hooks);
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_FALSE(found->plan.scans.empty());
  EXPECT_FALSE(found->bound.has_value());
}

TEST(BoundedPlanTest, ErrorsOfTheCallerEndIt) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  BoundedPlanHooks hooks;
  hooks.on_plan = [](const PlannerResult&) { return absl::DataLossError("no space"); };
  EXPECT_EQ(MakeBoundedPlan(gain_model, Request(1), kBoundEvaluations, hooks).status().code(),
            absl::StatusCode::kDataLoss);
}

}  // namespace
}  // namespace sightline
