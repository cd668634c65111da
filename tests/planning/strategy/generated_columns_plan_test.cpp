// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/generated_columns_plan.h"

#include <gtest/gtest.h>

#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

PlannerRequest SmallRequest(int64_t seed) {
  PlannerRequest request;
  request.domain = NineParameterDomain();
  request.goal.coverage = 0.9;
  request.evaluations_per_scan = 400;
  request.seed = seed;
  return request;
}

struct Planned {
  PlannerResult plan;
  ScanCountBoundResult bound;
};
Planned PlanAndBound(FunctionGainModel& gain_model, const PlannerRequest& request) {
  auto plan = MakePlan(gain_model, request);
  EXPECT_TRUE(plan.ok());
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : plan->scans) scans.push_back(scan.measurement);
  auto bound = BoundScanCount(gain_model, request.domain, request.goal.coverage, scans, 20000, 1);
  EXPECT_TRUE(bound.ok());
  return {*std::move(plan), *std::move(bound)};
}

TEST(GeneratedColumnsPlanTest, ReachesTheGoalWithNoMoreScansAndSometimesWithFewer) {
  size_t before = 0, after = 0;
  for (int64_t seed = 1; seed <= 4; ++seed) {
    FunctionGainModel gain_model = CastingGainModel(300, static_cast<uint64_t>(seed));
    const PlannerRequest request = SmallRequest(seed);
    const Planned planned = PlanAndBound(gain_model, request);
    ASSERT_EQ(planned.plan.stop_reason, StopReason::kGoalReached);
    const auto again = PlanWithGeneratedColumns(gain_model, request, planned.plan, planned.bound);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->stop_reason, StopReason::kGoalReached);
    EXPECT_GE(again->score.Claimed(), 270);
    EXPECT_LE(again->scans.size(), planned.plan.scans.size());
    EXPECT_GE(static_cast<double>(again->scans.size()), planned.bound.bound - 1e-6);
    EXPECT_GE(again->evaluations, planned.plan.evaluations);
    before += planned.plan.scans.size();
    after += again->scans.size();
  }
  EXPECT_LT(after, before);
}

TEST(GeneratedColumnsPlanTest, SameSeedSamePlan) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  const PlannerRequest request = SmallRequest(1);
  const Planned planned = PlanAndBound(gain_model, request);
  const auto one = PlanWithGeneratedColumns(gain_model, request, planned.plan, planned.bound);
  const auto two = PlanWithGeneratedColumns(gain_model, request, planned.plan, planned.bound);
  ASSERT_TRUE(one.ok() && two.ok());
  ASSERT_EQ(one->scans.size(), two->scans.size());
  for (size_t i = 0; i < one->scans.size(); ++i) {
    EXPECT_EQ(ToArray(one->scans[i].measurement), ToArray(two->scans[i].measurement));
  }
}

// A draft costs less than a plan, reaches the goal, and what follows needs about as few scans.
TEST(GeneratedColumnsPlanTest, ADraftIsEnoughToBeginWith) {
  size_t from_drafts = 0, from_plans = 0;
  int64_t drafts_cost = 0, plans_cost = 0;
  for (int64_t seed = 1; seed <= 4; ++seed) {
    FunctionGainModel gain_model = CastingGainModel(300, static_cast<uint64_t>(seed));
    const PlannerRequest request = SmallRequest(seed);
    PlannerRequest draft = request;
    draft.draft = true;
    const Planned planned = PlanAndBound(gain_model, request),
                  drafted = PlanAndBound(gain_model, draft);
    EXPECT_EQ(drafted.plan.stop_reason, StopReason::kGoalReached);
    EXPECT_GE(drafted.plan.score.Claimed(), 270);
    drafts_cost += drafted.plan.evaluations;
    plans_cost += planned.plan.evaluations;
    const auto plan = PlanWithGeneratedColumns(gain_model, request, planned.plan, planned.bound);
    const auto better = PlanWithGeneratedColumns(gain_model, request, drafted.plan, drafted.bound);
    ASSERT_TRUE(plan.ok() && better.ok());
    EXPECT_EQ(better->stop_reason, StopReason::kGoalReached);
    from_plans += plan->scans.size();
    from_drafts += better->scans.size();
  }
  EXPECT_LT(drafts_cost, plans_cost);
  EXPECT_LE(from_drafts, from_plans + 2);  // of four plans together
}

// Nothing is asked of the gain model where nothing can be gained.
TEST(GeneratedColumnsPlanTest, LeavesAlonePlansThatCannotBeImproved) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  const PlannerRequest request = SmallRequest(1);
  const Planned planned = PlanAndBound(gain_model, request);
  const int64_t evaluations = gain_model.evaluations();
  ScanCountBoundResult tight = planned.bound;
  tight.scans = static_cast<int>(planned.plan.scans.size());
  tight.converged = true;
  PlannerRequest greedy = request;
  greedy.strategy = "greedy-pso";
  PlannerResult stopped = planned.plan;
  stopped.stop_reason = StopReason::kMaxScans;
  for (const auto& result :
       {PlanWithGeneratedColumns(gain_model, request, planned.plan, tight),
        PlanWithGeneratedColumns(gain_model, greedy, planned.plan, planned.bound),
        PlanWithGeneratedColumns(gain_model, request, stopped, planned.bound)}) {
    ASSERT_TRUE(result.ok());
    EXPECT_EQ(result->scans.size(), planned.plan.scans.size());
  }
  EXPECT_EQ(gain_model.evaluations(), evaluations);
}

TEST(GeneratedColumnsPlanTest, KeepsLockedScansFirst) {
  FunctionGainModel gain_model = CastingGainModel(300, 2);
  PlannerRequest request = SmallRequest(2);
  const Planned free = PlanAndBound(gain_model, request);
  request.locked = {free.plan.scans.back().measurement};
  const Planned planned = PlanAndBound(gain_model, request);
  const auto again = PlanWithGeneratedColumns(gain_model, request, planned.plan, planned.bound);
  ASSERT_TRUE(again.ok());
  ASSERT_TRUE(again->scans[0].locked);
  EXPECT_EQ(ToArray(again->scans[0].measurement), ToArray(request.locked[0]));
}

}  // namespace
}  // namespace sightline
