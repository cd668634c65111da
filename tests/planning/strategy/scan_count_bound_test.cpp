// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/scan_count_bound.h"

#include <gtest/gtest.h>

#include "planning/strategy/planner.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

// A plan that covers nine tenths.
std::vector<Measurement> PlannedScans(FunctionGainModel& gain_model) {
  PlannerRequest request;
  request.domain = NineParameterDomain();
  request.goal.coverage = 0.9;
  request.evaluations_per_scan = 1500;
  const auto plan = MakePlan(gain_model, request);
  EXPECT_TRUE(plan.ok()) << plan.status();
  std::vector<Measurement> scans;
  if (!plan.ok()) return scans;
  EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached);
  for (const auto& scan : plan->scans) scans.push_back(scan.measurement);
  return scans;
}

TEST(ScanCountBoundTest, EqualsTheOptimumOfTheGreedyTrap) {
  FunctionGainModel gain_model = GreedyTrapGainModel();
  const auto result = BoundScanCount(gain_model, OffsetDomain(), 1.0, {}, 30000, 1);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_LE(result->bound, 2 + 1e-9);
  EXPECT_GT(result->bound, 1.98);
  EXPECT_EQ(result->scans, 2);
  EXPECT_TRUE(result->converged);
  EXPECT_LE(result->evaluations, 30000);
  EXPECT_EQ(result->evaluations, gain_model.evaluations());
}

TEST(ScanCountBoundTest, PartialGoalNeedsFewerScans) {
  // Ten discrete scans of disjoint sets of 1, 2, ..., 10 targets. Covering 40 of 55 takes the five
  // largest exactly (10 + 9 + 8 + 7 + 6); a fraction of a scan may count in the bound.
  std::vector<int> owner;
  for (int set = 0; set < 10; ++set) owner.insert(owner.end(), static_cast<size_t>(set) + 1, set);
  FunctionGainModel gain_model(55, [owner](const Measurement& m, size_t t) {
    return owner[t] == static_cast<int>(m.offset_y_m);
  });
  MeasurementDomain domain = OffsetDomain();
  domain.parameters[7] = {{}, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, false};
  const auto most = BoundScanCount(gain_model, domain, 40.0 / 55, {}, 40000, 1);
  ASSERT_TRUE(most.ok());
  EXPECT_NEAR(most->bound, 5, 0.03);
  EXPECT_LE(most->bound, 5 + 1e-9);
  // 43 of 55: five scans and 3 of the 5 targets of the sixth.
  const auto more = BoundScanCount(gain_model, domain, 43.0 / 55, {}, 40000, 1);
  ASSERT_TRUE(more.ok());
  EXPECT_NEAR(more->bound, 5.6, 0.03);
  EXPECT_EQ(more->scans, 6);
  const auto all = BoundScanCount(gain_model, domain, 1.0, {}, 40000, 1);
  ASSERT_TRUE(all.ok());
  EXPECT_NEAR(all->bound, 10, 0.05);
}

TEST(ScanCountBoundTest, NeverExceedsAPlanAndSaysWhatItRestsOn) {
  FunctionGainModel gain_model = CastingGainModel(300, 2);
  const std::vector<Measurement> scans = PlannedScans(gain_model);
  int reports = 0;
  const auto result = BoundScanCount(gain_model, NineParameterDomain(), 0.9, scans, 20000, 3,
                                     [&](const ScanCountBoundProgress&) { ++reports; });
  ASSERT_TRUE(result.ok());
  EXPECT_LE(result->scans, static_cast<int>(scans.size()));
  EXPECT_GT(result->bound, 1);
  EXPECT_LE(result->evaluations, 20000);
  EXPECT_GT(reports, 0);
  EXPECT_NE(result->statement.find("by the fast estimate"), std::string::npos);
  EXPECT_EQ(result->statement.find("found no scan") != std::string::npos, result->converged);
}

// A search too short to find good scans takes too few to be possible; a plan shows that it is.
TEST(ScanCountBoundTest, APlanThatWasFoundLaterIsTakenIntoAccount) {
  int too_high = 0;
  for (int64_t seed = 1; seed <= 5; ++seed) {
    FunctionGainModel gain_model = CastingGainModel(300, static_cast<uint64_t>(seed));
    const std::vector<Measurement> scans = PlannedScans(gain_model);
    const auto before = BoundScanCount(gain_model, NineParameterDomain(), 0.9, {}, 200, seed);
    ASSERT_TRUE(before.ok());
    too_high += before->bound > static_cast<double>(scans.size()) ? 1 : 0;
    ScanCountBoundResult after = *before;
    ASSERT_TRUE(TakeIntoAccount(gain_model, NineParameterDomain(), scans, after).ok());
    EXPECT_LE(after.bound, before->bound);
    EXPECT_LE(after.scans, static_cast<int>(scans.size()));
    EXPECT_GT(after.bound, 0);
    EXPECT_NE(after.statement.find("no lower bound yet"), std::string::npos);
    // Once known it changes nothing.
    ScanCountBoundResult again = after;
    ASSERT_TRUE(TakeIntoAccount(gain_model, NineParameterDomain(), scans, again).ok());
    EXPECT_NEAR(again.bound, after.bound, 1e-9);
    // The bound does not hold for scans outside the domain.
    std::vector<Measurement> outside = scans;
    outside.back().offset_y_m = 9;
    again = *before;
    ASSERT_TRUE(TakeIntoAccount(gain_model, NineParameterDomain(), outside, again).ok());
    EXPECT_EQ(again.bound, before->bound);
  }
  EXPECT_GT(too_high, 0);
}

// Weights that no scan brings more than 1 of bound plans for fewer targets as well.
TEST(ScanCountBoundTest, HoldsForFewerTargets) {
  ScanCountBoundResult bound;
  bound.weights = {0.5, 0.2, 9, 0.4};
  TargetBits measurable(4);
  for (const size_t t : {0, 1, 3}) measurable.Set(t);
  bound.goal_targets = bound.measurable_targets = 3;
  bound.bound = 1.1;
  bound.scans = 2;
  LowerGoal(measurable, 4, bound);
  EXPECT_EQ(bound.scans, 2);
  LowerGoal(measurable, 2, bound);
  EXPECT_NEAR(bound.bound, 0.6, 1e-12);
  EXPECT_EQ(bound.scans, 1);
  EXPECT_NE(bound.statement.find("2 of 3 targets"), std::string::npos) << bound.statement;

  // A bound for 95 % of the casting, lowered to what the first scans of a plan satisfy.
  FunctionGainModel gain_model = CastingGainModel(200, 2);
  const auto found = BoundScanCount(gain_model, NineParameterDomain(), 0.95, {}, 20000, 3);
  ASSERT_TRUE(found.ok());
  for (size_t n = 1; n <= 3; ++n) {
    const std::vector<Measurement> scans(
        found->generated_columns.begin(),
        found->generated_columns.begin() + static_cast<std::ptrdiff_t>(n));
    const auto coverage = gain_model.FastCoverage(scans);
    ASSERT_TRUE(coverage.ok());
    TargetBits covered(gain_model.measurable().size());
    for (const ScanCoverage& scan : *coverage) covered |= scan.covered;
    ScanCountBoundResult lower = *found;
    LowerGoal(gain_model.measurable(), covered.Count(), lower);
    EXPECT_LE(lower.bound, static_cast<double>(n) + 1e-9);
  }
}

TEST(ScanCountBoundTest, SameSeedSameBound) {
  FunctionGainModel a = CastingGainModel(200, 2), b = CastingGainModel(200, 2);
  const auto first = BoundScanCount(a, NineParameterDomain(), 0.9, {}, 10000, 3);
  const auto second = BoundScanCount(b, NineParameterDomain(), 0.9, {}, 10000, 3);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->bound, second->bound);
  EXPECT_EQ(first->statement, second->statement);
}

TEST(ScanCountBoundTest, InterruptionAndBadArguments) {
  FunctionGainModel gain_model = GreedyTrapGainModel();
  EXPECT_EQ(BoundScanCount(gain_model, OffsetDomain(), 0, {}, 100, 1).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(BoundScanCount(gain_model, OffsetDomain(), 0.9, {}, 0, 1).status().code(),
            absl::StatusCode::kInvalidArgument);
  const std::atomic<bool> interrupted = true;
  const auto result =
      BoundScanCount(gain_model, OffsetDomain(), 0.9, {}, 10000, 1, {}, &interrupted);
  ASSERT_TRUE(result.ok());
  EXPECT_FALSE(result->converged);
}

}  // namespace
}  // namespace sightline
