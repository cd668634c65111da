// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "planning/optimise/search_space.h"
#include "planning/strategy/scan_count_bound.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

PlannerRequest CastingRequest(const std::string& strategy) {
  PlannerRequest request;
  request.domain = NineParameterDomain();
  request.goal.coverage = 0.9;
  request.strategy = strategy;
  request.evaluations_per_scan = 1500;
  request.matrix_samples = 6000;
  return request;
}

PlannerRequest TrapRequest(const std::string& strategy) {
  PlannerRequest request;
  request.domain = OffsetDomain();
  request.goal.coverage = 1;
  request.strategy = strategy;
  request.evaluations_per_scan = 2000;
  request.matrix_samples = 4000;
  return request;
}

std::vector<Measurement> Scans(const PlannerResult& plan) {
  std::vector<Measurement> scans;
  for (const auto& scan : plan.scans) scans.push_back(scan.measurement);
  return scans;
}

// Properties of every plan: curve and gains are those of the exact coverage, and the scans
// after the locked ones come in the order of greatest gain.
void ExpectConsistent(FunctionGainModel& gain_model, const PlannerResult& plan) {
  ASSERT_EQ(plan.coverage_curve.size(), plan.scans.size());
  const std::vector<Measurement> scans = Scans(plan);
  const auto exact = gain_model.ExactCoverage(scans);
  TargetBits covered(gain_model.measurable().size());
  for (size_t i = 0; i < scans.size(); ++i) {
    EXPECT_EQ(plan.scans[i].exact.covered, (*exact)[i].covered);
    EXPECT_EQ(plan.scans[i].exact.feasibility, ScanFeasibility::kFeasible);
    const int64_t gain = (*exact)[i].covered.CountNotIn(covered);
    for (size_t later = i + 1; later < scans.size() && !plan.scans[i].locked; ++later) {
      EXPECT_GE(gain, (*exact)[later].covered.CountNotIn(covered));
    }
    covered |= (*exact)[i].covered;
    EXPECT_DOUBLE_EQ(plan.coverage_curve[i],
                     static_cast<double>(covered.Count()) /
                         static_cast<double>(gain_model.measurable().Count()));
  }
}

class StrategyTest : public testing::TestWithParam<std::string> {};

TEST_P(StrategyTest, ReachesTheGoalWithConsistentNumbers) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  int reports = 0;
  PlannerRequest request = CastingRequest(GetParam());
  request.on_progress = [&](const PlanProgress& progress) {
    ++reports;
    EXPECT_FALSE(progress.phase.empty());
    EXPECT_EQ(progress.goal, 0.9);
  };
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached);
  EXPECT_GE(plan->coverage_curve.back(), 0.9);
  EXPECT_GT(reports, 0);
  ExpectConsistent(gain_model, *plan);
  if (GetParam() != "matrix") {
    EXPECT_LE(plan->evaluations,
              request.evaluations_per_scan * static_cast<int64_t>(plan->scans.size()));
  }
}

TEST_P(StrategyTest, SameSeedSamePlan) {
  PlannerRequest request = CastingRequest(GetParam());
  request.goal.coverage = 0.7;
  request.evaluations_per_scan = 600;
  request.seed = 11;
  FunctionGainModel a = CastingGainModel(200, 1), b = CastingGainModel(200, 1);
  const auto first = MakePlan(a, request);
  const auto second = MakePlan(b, request);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(Scans(*first), Scans(*second));
  EXPECT_EQ(first->evaluations, second->evaluations);
  request.seed = 12;
  const auto third = MakePlan(a, request);
  ASSERT_TRUE(third.ok());
  EXPECT_NE(Scans(*first), Scans(*third));
}

TEST_P(StrategyTest, LockedScansStayFirstAndStartingScansArePartOfThePlan) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  PlannerRequest request = CastingRequest(GetParam());
  Measurement locked;
  locked.camera_distance_m = 0.6;
  locked.camera_polar_rad = 0.3;
  Measurement starting = locked;
  starting.part_alpha_rad = std::numbers::pi;
  request.locked = {locked};
  request.starting = {starting};
  request.goal.max_scans = 3;
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->scans.size(), 3u);
  EXPECT_EQ(plan->stop_reason, StopReason::kMaxScans);
  EXPECT_EQ(plan->scans[0].measurement, locked);
  EXPECT_TRUE(plan->scans[0].locked);
  EXPECT_FALSE(plan->scans[1].locked);
  if (GetParam() != "refined") {
    EXPECT_TRUE(plan->scans[1].measurement == starting || plan->scans[2].measurement == starting);
  }
  ExpectConsistent(gain_model, *plan);
}

TEST_P(StrategyTest, UnreachableGoalStalls) {
  // Half of the targets cannot be covered.
  FunctionGainModel gain_model(60,
                               [positions = GreedyTrapPositions()](const Measurement& m, size_t t) {
                                 return t % 2 == 0 && std::abs(positions[t] - m.offset_y_m) <= 0.25;
                               });
  PlannerRequest request = TrapRequest(GetParam());
  request.evaluations_per_scan = 500;
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->stop_reason, StopReason::kStalled);
  EXPECT_DOUBLE_EQ(plan->coverage_curve.back(), 0.5);
}

TEST_P(StrategyTest, InterruptionKeepsWhatIsPlanned) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  std::atomic<bool> interrupted = false;
  PlannerRequest request = CastingRequest(GetParam());
  request.interrupted = &interrupted;
  request.goal.coverage = 0.99;
  gain_model.set_on_query([&] {
    if (gain_model.evaluations() > 6000) interrupted = true;
  });
  if (GetParam() == "matrix") {
    request.matrix_samples = 10000000;
    request.on_progress = [&](const PlanProgress& progress) {
      if (progress.evaluations >= 2000) interrupted = true;
    };
  }
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->stop_reason, StopReason::kInterrupted);
  if (GetParam() != "matrix") {
    EXPECT_GE(plan->scans.size(), 2u);
    EXPECT_LT(plan->evaluations, 8000);
  }
  ExpectConsistent(gain_model, *plan);
}

std::vector<std::string> StrategyNames() {
  std::vector<std::string> names;
  for (const StrategyDescription& strategy : Strategies()) names.push_back(strategy.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(All, StrategyTest, testing::ValuesIn(StrategyNames()),
                         [](const auto& instance) {
                           std::string name = instance.param;
                           std::erase(name, '-');
                           return name;
                         });

TEST(GreedyTrapTest, GreedyNeedsThreeScansAndRefinedTheOptimumOfTwo) {
  for (int64_t seed = 1; seed <= 3; ++seed) {
    for (const char* strategy : {"greedy-pso", "greedy-cmaes", "matrix"}) {
      FunctionGainModel gain_model = GreedyTrapGainModel();
      PlannerRequest request = TrapRequest(strategy);
      request.seed = seed;
      const auto plan = MakePlan(gain_model, request);
      ASSERT_TRUE(plan.ok());
      EXPECT_EQ(plan->scans.size(), 3u) << strategy;
      EXPECT_EQ(plan->coverage_curve.back(), 1);
    }
    FunctionGainModel gain_model = GreedyTrapGainModel();
    PlannerRequest request = TrapRequest("refined");
    request.seed = seed;
    const auto plan = MakePlan(gain_model, request);
    ASSERT_TRUE(plan.ok());
    EXPECT_EQ(plan->scans.size(), 2u);
    EXPECT_EQ(plan->coverage_curve.back(), 1);
  }
}

TEST(ScanCountTest, SettlesMostWithSoManyScansWhateverTheGoal) {
  FunctionGainModel gain_model = GreedyTrapGainModel();
  PlannerRequest request = TrapRequest("refined");
  request.goal.coverage = 0.1;
  request.goal.max_scans = 40;
  request.goal.min_gain = 0.9;
  request.scan_count = 1;
  const auto one = MakePlan(gain_model, request);
  ASSERT_TRUE(one.ok());
  ASSERT_EQ(one->scans.size(), 1u);
  EXPECT_EQ(one->score.satisfied, 40);  // the window in the middle
  EXPECT_EQ(one->stop_reason, StopReason::kMaxScans);
  request.scan_count = 2;
  const auto two = MakePlan(gain_model, request);
  ASSERT_TRUE(two.ok());
  EXPECT_EQ(two->scans.size(), 2u);
  EXPECT_EQ(two->score.satisfied, 60);
  // No more scans than it takes.
  request.scan_count = 5;
  const auto five = MakePlan(gain_model, request);
  ASSERT_TRUE(five.ok());
  EXPECT_EQ(five->scans.size(), 2u);
  request.scan_count = 0;
  EXPECT_THAT(std::string(MakePlan(gain_model, request).status().message()),
              HasSubstr("scan_count: 0 is not >= 1"));
  request.scan_count = 1;
  request.starting.resize(2);
  EXPECT_THAT(std::string(MakePlan(gain_model, request).status().message()),
              HasSubstr("at least the 2 locked and starting scans"));
}

TEST(ScanCountTest, GreedyStrategiesKeepToItToo) {
  for (const char* strategy : {"greedy-pso", "matrix"}) {
    FunctionGainModel gain_model = GreedyTrapGainModel();
    PlannerRequest request = TrapRequest(strategy);
    request.goal.coverage = 0.1;
    request.scan_count = 2;
    const auto plan = MakePlan(gain_model, request);
    ASSERT_TRUE(plan.ok());
    EXPECT_EQ(plan->scans.size(), 2u);
    EXPECT_EQ(plan->score.satisfied, 50);  // greedy: the middle, then one end
  }
}

TEST(RefinedPlanTest, CandidatesOfOnePlanHelpTheNext) {
  FunctionGainModel gain_model = CastingGainModel(300, 7);
  PlannerRequest request = CastingRequest("refined");
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok());
  EXPECT_GT(plan->candidates.size(), plan->scans.size());
  // With next to no effort of its own.
  request.evaluations_per_scan = 60;
  request.scan_count = static_cast<int>(plan->scans.size());
  const auto without = MakePlan(gain_model, request);
  request.candidates = plan->candidates;
  request.evaluations_per_scan += static_cast<int64_t>(plan->candidates.size());
  const auto with = MakePlan(gain_model, request);
  ASSERT_TRUE(without.ok() && with.ok());
  EXPECT_GT(with->score.satisfied, without->score.satisfied);
}

TEST(RefinedPlanTest, NeedsFewerScansThanGreedyForTheSameBudget) {
  std::vector<size_t> greedy_scans, refined_scans;
  for (int64_t seed = 1; seed <= 3; ++seed) {
    for (auto* scans : {&greedy_scans, &refined_scans}) {
      FunctionGainModel gain_model = CastingGainModel(300, 7);
      PlannerRequest request = CastingRequest(scans == &greedy_scans ? "greedy-pso" : "refined");
      request.goal.coverage = 0.95;
      request.seed = seed;
      const auto plan = MakePlan(gain_model, request);
      ASSERT_TRUE(plan.ok());
      EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached);
      scans->push_back(plan->scans.size());
      if (scans == &refined_scans) {
        EXPECT_LE(plan->evaluations,
                  request.evaluations_per_scan * static_cast<int64_t>(greedy_scans.back()));
      }
    }
  }
  std::sort(greedy_scans.begin(), greedy_scans.end());
  std::sort(refined_scans.begin(), refined_scans.end());
  EXPECT_LE(static_cast<double>(refined_scans[1]), 0.9 * static_cast<double>(greedy_scans[1]))
      << "greedy " << greedy_scans[1];
}

TEST(RefinedPlanTest, AimsAtTheExactGoalWhenFastIsOptimistic) {
  // Exact coverage misses one fast target in thirty of each scan.
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  FunctionGainModel fast = CastingGainModel(300, 1);
  gain_model.set_exact([&fast](const Measurement& m, size_t t) {
    const auto key = static_cast<uint64_t>(std::abs(m.offset_y_m) * 1e9);
    if (DeriveSeed(key, t) % 30 == 0) return false;
    const auto coverage = fast.FastCoverage({&m, 1});
    return (*coverage)[0].covered.Test(t);
  });
  PlannerRequest request = CastingRequest("refined");
  request.evaluations_per_scan = 600;
  request.goal.coverage = 0.85;
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached);
  EXPECT_GE(plan->coverage_curve.back(), 0.85);
  ExpectConsistent(gain_model, *plan);
}

TEST(RefinedPlanTest, ReplacesScansThatAreInfeasibleExactly) {
  FunctionGainModel gain_model = GreedyTrapGainModel();
  // Only exact evaluation knows of an obstacle that takes away part of the places.
  gain_model.set_exact_feasibility([](const Measurement& m) {
    return m.offset_y_m > 0.245 && m.offset_y_m < 0.25 ? ScanFeasibility::kCollision
                                                       : ScanFeasibility::kFeasible;
  });
  for (const char* strategy : {"refined", "greedy-pso"}) {
    PlannerRequest request = TrapRequest(strategy);
    const auto plan = MakePlan(gain_model, request);
    ASSERT_TRUE(plan.ok()) << plan.status();
    EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached) << strategy;
    ExpectConsistent(gain_model, *plan);
  }
}

TEST(MakePlanTest, RejectsBadRequests) {
  FunctionGainModel gain_model = GreedyTrapGainModel();
  PlannerRequest request = TrapRequest("greedy-psi");
  auto plan = MakePlan(gain_model, request);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(plan.status().message(), HasSubstr("nearest is \"greedy-pso\""));

  request = TrapRequest("refined");
  request.goal.coverage = 1.5;
  plan = MakePlan(gain_model, request);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(plan.status().message(), HasSubstr("1.5"));

  request = TrapRequest("refined");
  request.locked = {Measurement{}};
  gain_model.set_feasibility([](const Measurement&) { return ScanFeasibility::kTravel; });
  plan = MakePlan(gain_model, request);
  EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(plan.status().message(), HasSubstr("locked scan 1"));
}

TEST(MakePlanTest, FixedParametersAndListsAreKept) {
  FunctionGainModel gain_model = CastingGainModel(300, 1);
  PlannerRequest request = CastingRequest("refined");
  request.domain.parameters[0] = {{}, {0.5}, false};
  request.domain.parameters[1] = {{}, {0.2, -0.2}, false};
  request.domain.resting_orientations = {{0, 0}, {std::numbers::pi, 0}, {std::numbers::pi / 2, 0}};
  request.goal.max_scans = 4;
  const auto plan = MakePlan(gain_model, request);
  ASSERT_TRUE(plan.ok());
  EXPECT_EQ(plan->scans.size(), 4u);
  for (const auto& scan : plan->scans) {
    const Measurement& m = scan.measurement;
    EXPECT_EQ(m.camera_distance_m, 0.5);
    EXPECT_EQ(std::abs(m.triangulation_angle_rad), 0.2);
    EXPECT_EQ(m.part_beta_rad, 0);
  }
}

TEST(MakePlanTest, NothingMeasurableIsAnEmptyPlan) {
  FunctionGainModel gain_model = GreedyTrapGainModel();
  for (size_t t = 0; t < 60; ++t) gain_model.RemoveMeasurable(t);
  for (const StrategyDescription& strategy : Strategies()) {
    const auto plan = MakePlan(gain_model, TrapRequest(strategy.name));
    ASSERT_TRUE(plan.ok()) << strategy.name << ": " << plan.status();
    EXPECT_TRUE(plan->scans.empty()) << strategy.name;
  }
}

TEST(PlanForShares, ScansAddUpUntilTargetsAreSettled) {
  // Every target needs three of the scans that reach half of the line: six scans at the least.
  for (const char* strategy : {"refined", "greedy-pso", "greedy-cmaes"}) {
    ShareGainModel gain_model;
    PlannerRequest request;
    request.domain = OffsetDomain();
    request.goal.coverage = 0;
    request.goal.admissible = 1.0;
    request.strategy = strategy;
    request.evaluations_per_scan = 2000;
    const auto plan = MakePlan(gain_model, request);
    ASSERT_TRUE(plan.ok()) << strategy << plan.status();
    EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached) << strategy;
    EXPECT_EQ(plan->score.satisfied, static_cast<int64_t>(ShareGainModel::kTargets));
    EXPECT_GE(plan->scans.size(), 6u);
    EXPECT_LE(plan->scans.size(), std::string(strategy) == "refined" ? 7u : 9u) << strategy;
    ASSERT_EQ(plan->coverage_curve.size(), plan->scans.size());
    EXPECT_EQ(plan->coverage_curve.front(), 0);  // one scan satisfies nothing
    EXPECT_EQ(plan->coverage_curve.back(), 1);
  }
}

TEST(PlanForShares, TheBoundCountsWhatEveryTargetNeeds) {
  ShareGainModel gain_model;
  const auto bound = BoundScanCount(gain_model, OffsetDomain(), 1.0, {}, 30000, 1);
  ASSERT_TRUE(bound.ok()) << bound.status();
  // Both ends of the line need 1 / 0.4 scans each, and no scan reaches both: 5. The search for
  // weights comes near that from below.
  EXPECT_LE(bound->bound, 5 + 1e-6);
  EXPECT_GE(bound->bound, 4.75);
}

}  // namespace
}  // namespace sightline
