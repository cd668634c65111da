// SPDX-License-Identifier: Apache-2.0
#include "planner_client/replanning/measured_gain_model.h"

#include <gtest/gtest.h>

#include <memory>

#include "planning/strategy/planner.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

constexpr size_t kTargets = 100;

// A scan at offset y covers the targets within 0.12 of y, which lie on a line from 0 to 1.
bool Covers(const Measurement& m, size_t t) {
  return std::abs(0.01 * static_cast<double>(t) - (m.offset_y_m + 0.5)) <= 0.12;
}

Measurement At(double offset_y_m) {
  Measurement m;
  m.camera_distance_m = 0.4;
  m.triangulation_angle_rad = 0.5;
  m.offset_y_m = offset_y_m;
  return m;
}

// The scan at 0 was measured, and its points cover the targets 30 to 49 instead of 38 to 62.
std::unique_ptr<MeasuredGainModel> MeasuredModel(std::unique_ptr<FunctionGainModel> simulated) {
  MeasuredTargets told;
  told.covered.emplace_back(kTargets);
  for (size_t t = 30; t < 50; ++t) told.covered[0].Set(t);
  told.points = {1234};
  return std::make_unique<MeasuredGainModel>(std::move(simulated), std::vector<Measurement>{At(0)},
                                             std::move(told), std::nullopt, 0);
}

TEST(MeasuredGainModel, MeasuredScansSettleWhatTheirPointsSay) {
  const auto gain_model = MeasuredModel(std::make_unique<FunctionGainModel>(kTargets, Covers));
  const std::vector<Measurement> asked = {At(0.3), At(0)};
  for (const auto& coverage : {gain_model->FastCoverage(asked), gain_model->ExactCoverage(asked)}) {
    ASSERT_TRUE(coverage.ok());
    EXPECT_TRUE((*coverage)[0].covered.Test(80));
    EXPECT_FALSE((*coverage)[0].covered.Test(40));
    EXPECT_TRUE((*coverage)[1].covered.Test(30));
    EXPECT_FALSE((*coverage)[1].covered.Test(60));
    EXPECT_EQ((*coverage)[1].covered.Count(), 20);
  }
  EXPECT_EQ((*gain_model->ExactCoverage(asked))[1].measurement_points, 1234);
}

TEST(MeasuredGainModel, ForwardsWeightsOfTheGain) {
  auto weighted = std::make_unique<WeightedGainModel>(kTargets, Covers);
  const WeightedGainModel& asked = *weighted;
  const auto gain_model = MeasuredModel(std::move(weighted));
  EXPECT_TRUE(gain_model->SetWeights({.information = 0.5}).ok());
  EXPECT_EQ(asked.weights().information, 0.5);
}

// A scan that has been made is feasible, whatever simulation says.
TEST(MeasuredGainModel, MeasuredScansAreFeasible) {
  auto simulated = std::make_unique<FunctionGainModel>(kTargets, Covers);
  simulated->set_feasibility([](const Measurement& m) {
    return m.offset_y_m == 0 ? ScanFeasibility::kCollision : ScanFeasibility::kFeasible;
  });
  const auto gain_model = MeasuredModel(std::move(simulated));
  const auto exact = gain_model->ExactCoverage(std::vector<Measurement>{At(0)});
  ASSERT_TRUE(exact.ok());
  EXPECT_EQ((*exact)[0].feasibility, ScanFeasibility::kFeasible);
}

// The planner keeps the measured scan, in front, and satisfies what its points left open.
TEST(MeasuredGainModel, PlansGoOnFromWhatPointsSettle) {
  const auto gain_model = MeasuredModel(std::make_unique<FunctionGainModel>(kTargets, Covers));
  PlannerRequest request;
  request.domain = ThesisDomain();
  for (size_t p = 0; p < kMeasurementParameters; ++p) {
    if (p == 7) continue;  // the offset along y
    request.domain.parameters[p].ranges.clear();
    request.domain.parameters[p].values = {ToArray(At(0))[p]};
  }
  request.goal.coverage = 0.95;
  request.evaluations_per_scan = 1000;
  request.locked = {At(0)};
  const auto plan = MakePlan(*gain_model, request);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->stop_reason, StopReason::kGoalReached);
  ASSERT_GE(plan->scans.size(), 2u);
  EXPECT_EQ(plan->scans[0].measurement, At(0));
  EXPECT_TRUE(plan->scans[0].locked);
  TargetBits covered(kTargets);
  for (size_t t = 30; t < 50; ++t) covered.Set(t);
  for (size_t i = 1; i < plan->scans.size(); ++i) {
    for (size_t t = 0; t < kTargets; ++t) {
      if (Covers(plan->scans[i].measurement, t)) covered.Set(t);
    }
  }
  EXPECT_GE(covered.Count(), 95);
}

}  // namespace
}  // namespace sightline
