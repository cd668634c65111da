// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/execution_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/random/random.h"
#include "planning/strategy/scan_order.h"

namespace sightline {
namespace {

ExecutionModel ByHand() {
  ExecutionModel model;
  model.costs.lay_time_s = 180;
  model.costs.turn_time_s = 60;
  model.costs.move_sensors_time_s = 900;
  return model;
}

Measurement ScanAt(double polar_rad, double alpha_rad, double gamma_rad) {
  Measurement scan;
  scan.camera_polar_rad = polar_rad;
  scan.part_alpha_rad = alpha_rad;
  scan.part_gamma_rad = gamma_rad;
  return scan;
}

TEST(ExecutionModelTest, EveryChangeHasItsTime) {
  const ExecutionModel model = ByHand();
  const Measurement a = ScanAt(0.2, 0, 0);
  EXPECT_EQ(RepositionTimeS(model, a, a), 0);
  EXPECT_EQ(RepositionTimeS(model, a, ScanAt(0.2, 0, 1)), 60);
  EXPECT_EQ(RepositionTimeS(model, a, ScanAt(0.2, 1, 1)), 180);  // laying turns it too
  EXPECT_EQ(RepositionTimeS(model, a, ScanAt(0.3, 0, 0)), 900);
  EXPECT_EQ(RepositionTimeS(model, a, ScanAt(0.3, 1, 1)), 1080);
  EXPECT_EQ(TimesBeforeFirst(model).Total_s(), 1080);
}

TEST(ExecutionModelTest, AFixedTableIsPartOfThePlaceOfTheSensors) {
  ExecutionModel model = ByHand();
  // A box of 0.1 x 0.1 x 0.04 m: its centre is 0.02 m over the table lying, 0.05 m standing.
  std::vector<Eigen::Vector3d> corners;
  for (const double x : {-0.05, 0.05}) {
    for (const double y : {-0.05, 0.05}) {
      for (const double z : {-0.02, 0.02}) corners.push_back({x, y, z});
    }
  }
  model.support_points_m = std::make_shared<const std::vector<Eigen::Vector3d>>(corners);
  Measurement lying, standing;
  standing.part_alpha_rad = 1.5707963267948966;
  EXPECT_NEAR(TableHeight(model, lying), -0.02, 1e-12);
  EXPECT_NEAR(TableHeight(model, standing), -0.05, 1e-12);
  EXPECT_TRUE(SamePlaceOfSensors(model, lying, standing));
  model.stage_moves_in_height = false;
  EXPECT_FALSE(SamePlaceOfSensors(model, lying, standing));
  const Measurement moved = AtPlaceOf(model, lying, standing);
  EXPECT_NEAR(moved.offset_z_m, 0.03, 1e-12);
  EXPECT_TRUE(SamePlaceOfSensors(model, lying, moved));
}

TEST(ExecutionModelTest, ARobotMovesItsHeadWithoutASetup) {
  ExecutionModel model = ByHand();
  model.robot_holds_head = true;
  EXPECT_TRUE(SamePlaceOfSensors(model, ScanAt(0.1, 0, 0), ScanAt(0.7, 0, 0)));
  EXPECT_EQ(CountSetups(model, std::vector{ScanAt(0.1, 0, 0), ScanAt(0.7, 1, 0)}).setups, 2);
}

// Two places with two faces each, three scans in each set-up, mixed.
TEST(ExecutionModelTest, ScansOfASetupFollowOneAnotherInTheLeastTime) {
  const ExecutionModel model = ByHand();
  Random random(3);
  std::vector<Measurement> scans;
  for (const double polar : {0.1, 0.5}) {
    for (const double alpha : {0.0, 1.5}) {
      for (const double gamma : {0.0, 1.0, 2.0}) scans.push_back(ScanAt(polar, alpha, gamma));
    }
  }
  for (size_t i = scans.size(); i > 1; --i) {
    std::swap(scans[i - 1], scans[static_cast<size_t>(random.Below(static_cast<int64_t>(i)))]);
  }
  const std::vector<int> order = OrderScans(model, scans);
  std::vector<Measurement> ordered;
  for (const int i : order) ordered.push_back(scans[static_cast<size_t>(i)]);
  EXPECT_EQ(SetupsOf(model, ordered).size(), 4u);
  // One move of the sensors, two times another face (not at the move), two turns in each set-up.
  EXPECT_EQ(TotalRepositionTimeS(model, scans, order), 900 + 2 * 180 + 8 * 60);
}

// With so few scans every order can be tried.
TEST(ExecutionModelTest, NoOrderTakesLessTime) {
  const ExecutionModel model = ByHand();
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    Random random(seed);
    std::vector<Measurement> scans;
    for (int i = 0; i < 7; ++i) {
      scans.push_back(ScanAt(0.1 * static_cast<double>(random.Below(3)),
                             static_cast<double>(random.Below(3)),
                             static_cast<double>(random.Below(3))));
    }
    for (const int locked : {0, 2}) {
      std::vector<int> trial(7);
      std::iota(trial.begin(), trial.end(), 0);
      double best_s = 1e300;
      do {
        best_s = std::min(best_s, TotalRepositionTimeS(model, scans, trial));
      } while (std::next_permutation(trial.begin() + locked, trial.end()));
      const std::vector<int> order = OrderScans(model, scans, locked);
      EXPECT_NEAR(TotalRepositionTimeS(model, scans, order), best_s, 1e-9) << seed << locked;
    }
  }
}

}  // namespace
}  // namespace sightline
