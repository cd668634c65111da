// SPDX-License-Identifier: Apache-2.0
#include "planner_client/gain_model/reachable_gain_model.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "planning/strategy/planner.h"
#include "tests/planning/analytic_gain_model.h"
#include "tests/planning/robot/cell_fixture.h"

namespace sightline {
namespace {

class ReachableGainModelTest : public CellTest {
 protected:
  // Target t is covered by scans from its sixteenth of the azimuths.
  static std::unique_ptr<FunctionGainModel> Azimuths() {
    return std::make_unique<FunctionGainModel>(16, [](const Measurement& m, size_t t) {
      return static_cast<size_t>(m.camera_azimuth_rad / (2 * kPi) * 16) == t;
    });
  }
  static MeasurementDomain Domain() {
    MeasurementDomain domain = ThesisDomain();
    for (size_t p = 0; p < domain.parameters.size(); ++p) {
      if (p == 2) continue;
      domain.parameters[p].ranges.clear();
      domain.parameters[p].values = {ToArray(Tilted(0))[p]};
    }
    return domain;
  }
  static Measurement Tilted(double azimuth_rad) {
    Measurement scan = HeadScan();
    scan.camera_polar_rad = 0.9;
    scan.camera_azimuth_rad = azimuth_rad;
    return scan;
  }
  static ScanTravel Travel(const Measurement&) { return {-0.1, 0.1}; }
  // So far from the part that it is reached from one side only.
  static std::shared_ptr<const RobotCell> OneSidedCell() {
    CellTask task = HeadTask();
    task.mount.base.translation() = Eigen::Vector3d(0, -1.05, 0);
    return Make(std::move(task));
  }
};

TEST_F(ReachableGainModelTest, AsksOnlyForWhatIsReached) {
  const auto cell = OneSidedCell();
  ASSERT_NE(cell, nullptr);
  auto inner = Azimuths();
  FunctionGainModel* asked = inner.get();
  ReachableGainModel gain_model(std::move(inner), cell, Travel, 0.001);
  std::vector<Measurement> scans;
  for (int i = 0; i < 16; ++i) scans.push_back(Tilted((i + 0.5) * 2 * kPi / 16));
  const std::vector<float> nothing(16, 0);
  const auto gains = gain_model.Gains(scans, nothing);
  ASSERT_TRUE(gains.ok()) << gains.status();
  int reached = 0;
  for (size_t i = 0; i < scans.size(); ++i) {
    const bool can = cell->Reachable(scans[i], Travel(scans[i]), false).reachable();
    reached += can;
    EXPECT_EQ((*gains)[i].feasibility,
              can ? ScanFeasibility::kFeasible : ScanFeasibility::kUnreachable);
    EXPECT_EQ((*gains)[i].gain, can ? 1 : 0) << i;
  }
  EXPECT_GT(reached, 2);
  EXPECT_LT(reached, 14);
  EXPECT_EQ(asked->evaluations(), reached);
  EXPECT_EQ(gain_model.evaluations(), 16);
  const auto exact = gain_model.ExactCoverage(scans);
  ASSERT_TRUE(exact.ok()) << exact.status();
  for (size_t i = 0; i < scans.size(); ++i) {
    EXPECT_EQ((*exact)[i].covered.Count(), (*gains)[i].gain);
    EXPECT_EQ((*exact)[i].covered.size(), 16u);
  }
}

// As the page of `sightline explore` asks: the same of many threads at once.
TEST_F(ReachableGainModelTest, AnswersSeveralThreads) {
  const auto cell = OneSidedCell();
  ASSERT_NE(cell, nullptr);
  ReachableGainModel gain_model(Azimuths(), cell, Travel, 0.001);
  std::vector<Measurement> scans;
  for (int i = 0; i < 16; ++i) scans.push_back(Tilted((i + 0.5) * 2 * kPi / 16));
  std::vector<std::vector<ScanCoverage>> answers(4);
  {
    std::vector<std::jthread> threads;
    for (auto& answer : answers) {
      threads.emplace_back([&] { answer = gain_model.ExactCoverage(scans).value(); });
    }
  }
  int reached = 0;
  for (size_t i = 0; i < scans.size(); ++i) {
    const bool can = cell->Reachable(scans[i], Travel(scans[i]), false).reachable();
    reached += can;
    for (const auto& answer : answers) {
      EXPECT_EQ(answer[i].feasibility,
                can ? ScanFeasibility::kFeasible : ScanFeasibility::kUnreachable);
    }
  }
  EXPECT_GT(reached, 2);
  EXPECT_LT(reached, 14);
}

TEST_F(ReachableGainModelTest, KeptScansAreThereReachedOrNot) {
  const auto cell = OneSidedCell();
  ASSERT_NE(cell, nullptr);
  ReachableGainModel gain_model(Azimuths(), cell, Travel, 0.001);
  const Measurement far = Tilted(kPi / 2);
  ASSERT_FALSE(cell->Reachable(far, Travel(far), false).reachable());
  gain_model.Keep({&far, 1});
  const auto exact = gain_model.ExactCoverage({&far, 1});
  ASSERT_TRUE(exact.ok()) << exact.status();
  EXPECT_EQ(exact->front().feasibility, ScanFeasibility::kFeasible);
  EXPECT_EQ(exact->front().covered.Count(), 1);
}

TEST_F(ReachableGainModelTest, ForwardsWeightsOfTheGain) {
  const auto cell = OneSidedCell();
  ASSERT_NE(cell, nullptr);
  auto weighted =
      std::make_unique<WeightedGainModel>(1, [](const Measurement&, size_t) { return true; });
  const WeightedGainModel& asked = *weighted;
  ReachableGainModel gain_model(std::move(weighted), cell, Travel, 0.001);
  EXPECT_TRUE(gain_model.SetWeights({.admissible = 0.25, .relaxed = 0.75}).ok());
  EXPECT_EQ(asked.weights().admissible, 0.25);
  EXPECT_EQ(asked.weights().relaxed, 0.75);
  ReachableGainModel without(Azimuths(), cell, Travel, 0.001);
  EXPECT_EQ(without.SetWeights({}).code(), absl::StatusCode::kUnimplemented);
}

TEST_F(ReachableGainModelTest, StrategiesHonourIt) {
  const auto cell = OneSidedCell();
  ASSERT_NE(cell, nullptr);
  for (const char* strategy : {"refined", "greedy-pso-1", "matrix"}) {
    ReachableGainModel gain_model(Azimuths(), cell, Travel, 0.001);
    PlannerRequest request;
    request.domain = Domain();
    request.strategy = strategy;
    request.evaluations_per_scan = 200;
    request.matrix_samples = 400;
    request.goal.coverage = 1;
    const auto plan = MakePlan(gain_model, request);
    ASSERT_TRUE(plan.ok()) << plan.status();
    EXPECT_GT(plan->scans.size(), 2u) << strategy;
    EXPECT_LT(plan->scans.size(), 14u) << strategy;
    for (const ChosenScan& scan : plan->scans) {
      EXPECT_TRUE(cell->Reachable(scan.measurement, {-0.1, 0.1}, false).reachable()) << strategy;
    }
  }
}

}  // namespace
}  // namespace sightline
