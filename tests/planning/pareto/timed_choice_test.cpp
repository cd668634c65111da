// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/timed_choice.h"

#include <gtest/gtest.h>

#include <vector>

#include "planning/strategy/target_shares.h"

namespace sightline {
namespace {

// Scans of some targets and seconds each, at places along y.
class TimedChoiceTest : public testing::Test {
 protected:
  static constexpr size_t kTargets = 24;

  TimedChoiceTest() : pool_({{1.0, {1.0f}}}, AllTargets()) {
    execution_.costs.reposition_time_s = 1;
  }

  static std::vector<uint32_t> AllTargets() {
    std::vector<uint32_t> targets;
    for (uint32_t t = 0; t < kTargets; ++t) targets.push_back(t);
    return targets;
  }
  void Add(uint32_t mask, double seconds, double y_m = 0) {
    TargetShares shares;
    for (uint32_t t = 0; t < kTargets; ++t) {
      if (mask >> t & 1) {
        shares.targets.push_back(t);
        shares.share.push_back(1);
      }
    }
    pool_.Add(shares);
    Measurement scan;
    scan.offset_y_m = y_m;
    scans_.push_back(scan);
    seconds_.push_back(seconds);
  }
  void AddRandomScans(int count, uint64_t seed) {
    Random random(seed);
    for (int i = 0; i < count; ++i) {
      uint32_t mask = 0;
      for (uint32_t t = 0; t < kTargets; ++t) mask |= uint32_t{random.Uniform() < 0.25} << t;
      Add(mask, 1 + 9 * random.Uniform(), random.Uniform());
    }
  }
  TimedChoice Choice() const { return TimedChoice(execution_, pool_, scans_, seconds_); }
  PoolPlan Best(double limit_s, size_t most_scans = 100, PoolPlan start = {},
                size_t fixed = 0) const {
    Random random(1);
    return Choice().Improve(std::move(start), fixed, limit_s, most_scans, 30, random,
                            [] { return false; });
  }
  // The most that any plan is worth within the limit, by trying all.
  double MostWorth(double limit_s) const {
    double most = 0;
    for (uint32_t set = 0; set < uint32_t{1} << scans_.size(); ++set) {
      PoolPlan plan;
      for (size_t i = 0; i < scans_.size(); ++i) {
        if (set >> i & 1) plan.push_back(i);
      }
      if (const double worth = pool_.Worth(plan); worth > most) {
        if (Choice().TimeS(plan, 0) <= limit_s) most = worth;
      }
    }
    return most;
  }

  ExecutionModel execution_;
  ScanPool pool_;
  std::vector<Measurement> scans_;
  std::vector<double> seconds_;
};

TEST_F(TimedChoiceTest, FindsTheBestPlanWithinEveryLimit) {
  execution_.costs.reposition_speed_m_per_s = 0.2;  // up to 5 s
  AddRandomScans(11, 5);
  for (const double limit_s : {2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 60.0}) {
    const PoolPlan plan = Best(limit_s);
    EXPECT_LE(Choice().TimeS(plan, 0), limit_s);
    EXPECT_EQ(pool_.Worth(plan), MostWorth(limit_s)) << limit_s;
  }
}

TEST_F(TimedChoiceTest, PrefersTwoQuickScansToALongOneThatSettlesMoreThanEach) {
  Add(0x00ff, 10);
  Add(0x003f, 3);
  Add(0x0fc0, 3);
  EXPECT_EQ(pool_.Worth(Best(8)), 12);
  EXPECT_EQ(Best(8, 1).size(), 1u);
}

TEST_F(TimedChoiceTest, OfPlansOfEqualWorthTheQuickerOneIsTaken) {
  Add(0x00ff, 10);
  Add(0x00ff, 4);
  const PoolPlan plan = Best(20, 1, {0});
  ASSERT_EQ(plan.size(), 1u);
  EXPECT_EQ(plan[0], 1u);
}

TEST_F(TimedChoiceTest, ShorteningGivesUpTheLeastPerSecondAndKeepsFixedScans) {
  Add(0x0001, 6);
  Add(0x00f0, 6);
  Add(0x0f00, 2);
  PoolPlan plan = {0, 1, 2};  // 14 s and two moves of 1 s
  Choice().Shorten(plan, 0, 12);
  EXPECT_EQ(plan, (PoolPlan{1, 2}));
  plan = {0, 1, 2};
  Choice().Shorten(plan, 1, 10);
  EXPECT_EQ(plan, (PoolPlan{0, 2}));
  plan = {0, 1, 2};
  Choice().Shorten(plan, 1, 1);
  EXPECT_EQ(plan, (PoolPlan{0}));
}

TEST_F(TimedChoiceTest, AddedSecondsAreThoseOfTheBestPlaceInTheOrder) {
  execution_.costs.reposition_speed_m_per_s = 0.1;
  std::vector<Measurement> order(2);
  order[1].offset_y_m = 0.5;
  Measurement between;
  between.offset_y_m = 0.2;
  // Between the two: no way more, one fixed time more.
  EXPECT_NEAR(Choice().AddedS(order, 0, between, 7), 7 + 1, 1e-12);
  // Behind locked scans only: 0.3 m back.
  EXPECT_NEAR(Choice().AddedS(order, 2, between, 7), 7 + 1 + 3, 1e-12);
  EXPECT_NEAR(Choice().AddedS({}, 0, between, 7), 7, 1e-12);
}

TEST_F(TimedChoiceTest, NothingFitsAndAnEmptyPoolAreEmptyPlans) {
  EXPECT_TRUE(Best(10).empty());
  Add(0x00ff, 10);
  EXPECT_TRUE(Best(5).empty());
}

}  // namespace
}  // namespace sightline
