// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/least_time_plan.h"

#include <gtest/gtest.h>

#include <memory>
#include <numbers>
#include <numeric>
#include <vector>

#include "planning/strategy/execution/setup_choice.h"
#include "planning/strategy/scan_order.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

CostModel CostsByHand() {
  CostModel costs;
  costs.lay_time_s = 180;
  costs.turn_time_s = 60;
  costs.move_sensors_time_s = 900;
  return costs;
}

// A pool of random scans from three places with the part on two faces.
struct SmallPool {
  explicit SmallPool(uint64_t seed) : random(seed), pool({{1.0, {1.0f}}}, Targets()) {
    for (int i = 0; i < 12; ++i) {
      TargetShares shares;
      for (uint32_t t = 0; t < 40; ++t) {
        if (random.Uniform() > 0.35) continue;
        shares.targets.push_back(t);
        shares.share.push_back(1);
      }
      pool.Add(shares);
      setups.push_back({static_cast<size_t>(random.Below(3)), static_cast<size_t>(random.Below(2)),
                        5 + 5 * random.Uniform()});
    }
  }
  static std::vector<uint32_t> Targets() {
    std::vector<uint32_t> targets(40);
    std::iota(targets.begin(), targets.end(), 0u);
    return targets;
  }

  Random random;
  ScanPool pool;
  std::vector<SetupOfScan> setups;
};

TEST(SetupChoiceTest, FindsTheOptimumOfSmallPools) {
  const CostModel costs = CostsByHand();
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    SmallPool small(seed);
    for (const std::optional<int> places : {std::optional<int>(), std::optional<int>(1)}) {
      SetupLimits limits;
      limits.scans = 6;
      limits.places = places;
      const SetupChoice choice(small.pool, small.setups, costs, limits);
      // Most worth that the limits allow, at most the aim, in least time.
      constexpr double kAim = 30;
      double best_worth = 0, best_s = 0;
      for (size_t chosen = 0; chosen < (size_t{1} << 12); ++chosen) {
        PoolPlan plan;
        for (size_t i = 0; i < 12; ++i) {
          if (chosen >> i & 1) plan.push_back(i);
        }
        if (!choice.KeepsLimits(plan)) continue;
        const double worth = std::min(kAim, small.pool.Worth(plan)), time_s = choice.TimeS(plan);
        if (worth > best_worth || (worth == best_worth && time_s < best_s)) {
          best_worth = worth;
          best_s = time_s;
        }
      }
      const PoolPlan found = choice.Improve({}, 0, kAim, 400, small.random, [] { return false; });
      EXPECT_TRUE(choice.KeepsLimits(found));
      EXPECT_EQ(std::min(kAim, small.pool.Worth(found)), best_worth) << seed;
      EXPECT_NEAR(choice.TimeS(found), best_s, 1e-9) << seed;
    }
  }
}

class LeastTimePlanTest : public testing::Test {
 protected:
  static PlannerRequest Request(int64_t seed) {
    PlannerRequest request;
    request.domain = NineParameterDomain();
    request.goal.coverage = 0.9;
    request.evaluations_per_scan = 1000;
    request.seed = seed;
    request.execution.costs = CostsByHand();
    return request;
  }
  static double TimeOf(const PlannerRequest& request, const PlannerResult& plan) {
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : plan.scans) scans.push_back(scan.measurement);
    return TimesBeforeFirst(request.execution).Total_s() +
           TotalRepositionTimeS(request.execution, scans, OrderScans(request.execution, scans));
  }
  static SetupCounts CountsOf(const PlannerRequest& request, const PlannerResult& plan) {
    std::vector<Measurement> scans;
    for (const ChosenScan& scan : plan.scans) scans.push_back(scan.measurement);
    return CountSetups(request.execution, scans);
  }
};

TEST_F(LeastTimePlanTest, ReachesTheGoalInMuchLessTime) {
  for (int64_t seed = 1; seed <= 3; ++seed) {
    FunctionGainModel gain_model = CastingGainModel(300, static_cast<uint64_t>(seed));
    const PlannerRequest request = Request(seed);
    const auto plan = MakePlan(gain_model, request);
    ASSERT_TRUE(plan.ok());
    const auto quick = PlanInLeastTime(gain_model, request, *plan, {});
    ASSERT_TRUE(quick.ok()) << quick.status();
    EXPECT_EQ(quick->stop_reason, StopReason::kGoalReached);
    EXPECT_GE(quick->score.Claimed(), 270);
    EXPECT_LE(quick->scans.size(), plan->scans.size() + 1);
    EXPECT_LT(TimeOf(request, *quick), 0.8 * TimeOf(request, *plan));
    EXPECT_LT(CountsOf(request, *quick).places, CountsOf(request, *plan).places);
    EXPECT_GT(quick->evaluations, plan->evaluations);
    const auto again = PlanInLeastTime(gain_model, request, *plan, {});
    ASSERT_TRUE(again.ok());
    ASSERT_EQ(again->scans.size(), quick->scans.size());
    for (size_t i = 0; i < again->scans.size(); ++i) {
      EXPECT_EQ(again->scans[i].measurement, quick->scans[i].measurement);
    }
  }
}

TEST_F(LeastTimePlanTest, KeepsItsLimits) {
  FunctionGainModel gain_model = CastingGainModel(300, 2);
  PlannerRequest request = Request(2);
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok());
  request.goal.max_sensor_places = 2;
  const auto two_places = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(two_places.ok());
  EXPECT_LE(CountsOf(request, *two_places).places, 2);
  EXPECT_GT(two_places->score.satisfied, 0);
  request.goal.max_sensor_places.reset();
  request.goal.execution_time_s = 2500;
  const auto in_time = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(in_time.ok());
  EXPECT_LE(TimeOf(request, *in_time), 2500);
  EXPECT_GT(in_time->score.satisfied, 0);
  if (in_time->score.Claimed() < 270) {
    EXPECT_EQ(in_time->stop_reason, StopReason::kExecutionLimit);
  }
}

TEST_F(LeastTimePlanTest, NoPlanWhereTheFirstSetUpTakesTooLong) {
  FunctionGainModel gain_model = CastingGainModel(300, 2);
  PlannerRequest request = Request(2);
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok());
  // Laying the part down and placing the sensors takes 1080 s.
  request.goal.execution_time_s = 1000;
  const auto none = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_TRUE(none->scans.empty());
  EXPECT_EQ(none->stop_reason, StopReason::kExecutionLimit);
  request.goal.execution_time_s = 1100;
  const auto one = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_EQ(one->scans.size(), 1u);
  EXPECT_EQ(one->stop_reason, StopReason::kExecutionLimit);
}

// If the table stands still in height, a place of the sensors gives the part another height on
// every face.
TEST_F(LeastTimePlanTest, ScansStayInTheDomainWithATableOfFixedHeight) {
  FunctionGainModel gain_model = CastingGainModel(300, 3);
  PlannerRequest request = Request(3);
  request.execution.stage_moves_in_height = false;
  auto corners = std::make_shared<std::vector<Eigen::Vector3d>>();
  for (int corner = 0; corner < 8; ++corner) {
    corners->push_back(
        {corner & 1 ? 0.2 : -0.2, corner & 2 ? 0.12 : -0.12, corner & 4 ? 0.05 : -0.05});
  }
  request.execution.support_points_m = corners;
  request.domain.parameters[kPartAlpha] = {.ranges = {}, .values = {0}, .periodic = false};
  request.domain.parameters[kPartBeta] = {.ranges = {}, .values = {0}, .periodic = false};
  constexpr double kQuarter_rad = std::numbers::pi / 2;
  request.domain.resting_orientations = {
      {0, 0, "A"}, {2 * kQuarter_rad, 0, "B"}, {kQuarter_rad, 0, "C"}, {0, kQuarter_rad, "D"}};
  request.domain.parameters[kOffsetZ] = {
      .ranges = {{-0.05, 0.05}}, .values = {}, .periodic = false};
  request.goal.coverage = 0.5;
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const auto quick = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(quick.ok()) << quick.status();
  EXPECT_LE(TimeOf(request, *quick), TimeOf(request, *plan));
  for (const ChosenScan& scan : quick->scans)
    EXPECT_TRUE(request.domain.Contains(scan.measurement));
}

TEST_F(LeastTimePlanTest, LockedScansStay) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  PlannerRequest request = Request(1);
  request.locked = {MakePlan(gain_model, request)->scans[0].measurement};
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok());
  const auto quick = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(quick.ok());
  EXPECT_TRUE(quick->scans[0].locked);
  EXPECT_EQ(quick->scans[0].measurement, request.locked[0]);
}

TEST_F(LeastTimePlanTest, WithoutPricesOrLimitsThePlanStays) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  PlannerRequest request = Request(1);
  request.execution.costs = {};
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok());
  const auto same = PlanInLeastTime(gain_model, request, *plan, {});
  ASSERT_TRUE(same.ok());
  EXPECT_EQ(same->evaluations, plan->evaluations);
}

}  // namespace
}  // namespace sightline
