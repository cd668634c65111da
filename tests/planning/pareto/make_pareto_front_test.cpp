// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/make_pareto_front.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <tuple>
#include <vector>

#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Four clusters of ten targets on a line. A scan from 0.1 m away takes 3 s and sees one cluster,
// one from 0.3 m takes 10 s and sees two neighbours.
class ClusterGainModel final : public FunctionGainModel {
 public:
  ClusterGainModel()
      : FunctionGainModel(40, [](const Measurement& m, size_t t) {
          const size_t number = t / 10;
          const double cluster = 0.125 + 0.25 * static_cast<double>(number);
          const double position = cluster - 0.08 + 0.16 / 9 * static_cast<double>(t % 10);
          return std::abs(position - m.offset_y_m) <= (Wide(m) ? 0.225 : 0.1);
        }) {}
  static bool Wide(const Measurement& m) { return m.camera_distance_m > 0.2; }
  static FrameRange Frames(const Measurement& m) { return {0, Wide(m) ? 1000 : 300}; }

  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    auto coverages = FunctionGainModel::ExactCoverage(measurements);
    for (size_t i = 0; i < measurements.size(); ++i) {
      (*coverages)[i].last_frame = Frames(measurements[i]).last;
    }
    return coverages;
  }
};

ParetoRequest ClusterRequest() {
  ParetoRequest request;
  request.plan.domain = OffsetDomain();
  request.plan.domain.parameters[0] = {{}, {0.1, 0.3}, false};
  request.plan.goal.coverage = 1;
  request.plan.evaluations_per_scan = 2000;
  request.execution.costs.stage_speed_m_per_s = 0.1;
  request.scan_step_m = 0.001;
  request.estimate_frames = ClusterGainModel::Frames;
  return request;
}

ParetoRequest CastingRequest() {
  ParetoRequest request;
  request.plan.domain = NineParameterDomain();
  request.plan.goal.coverage = 0.8;
  request.plan.evaluations_per_scan = 1000;
  request.execution.costs.stage_speed_m_per_s = 0.1;
  request.execution.costs.reposition_time_s = 2;
  request.execution.costs.reposition_speed_rad_per_s = 0.5;
  request.time_limits = 6;
  return request;
}

// Scans, seconds, satisfied targets.
std::vector<std::tuple<size_t, int64_t, int64_t>> Objectives(const ParetoFront& front) {
  std::vector<std::tuple<size_t, int64_t, int64_t>> objectives;
  for (const ParetoPoint& point : front.points) {
    objectives.emplace_back(point.scans.size(), std::llround(point.time.Total_s()),
                            point.Claimed());
  }
  return objectives;
}

std::vector<Measurement> ScansOf(const ParetoPoint& point) {
  std::vector<Measurement> scans;
  for (const ChosenScan& scan : point.scans) scans.push_back(scan.measurement);
  return scans;
}

std::vector<std::vector<Measurement>> ScansOf(const ParetoFront& front) {
  std::vector<std::vector<Measurement>> scans;
  for (const ParetoPoint& point : front.points) scans.push_back(ScansOf(point));
  return scans;
}

TEST(MakeParetoFrontTest, FindsAFrontThatIsKnown) {
  ClusterGainModel gain_model;
  const auto made = MakeParetoFront(gain_model, ClusterRequest());
  ASSERT_TRUE(made.ok()) << made.status();
  using Point = std::tuple<size_t, int64_t, int64_t>;
  EXPECT_THAT(Objectives(made->front),
              ElementsAre(Point{1, 3, 10}, Point{1, 10, 20}, Point{2, 6, 20}, Point{2, 13, 30},
                          Point{2, 20, 40}, Point{3, 9, 30}, Point{3, 16, 40}, Point{4, 12, 40}));
  EXPECT_EQ(made->stop_reason, StopReason::kGoalReached);
}

TEST(MakeParetoFrontTest, AsksExactFramesWhereThereIsNoEstimate) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  const auto estimated = MakeParetoFront(gain_model, request);
  request.estimate_frames = nullptr;
  const auto exact = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(estimated.ok() && exact.ok());
  EXPECT_EQ(Objectives(estimated->front), Objectives(exact->front));
}

TEST(MakeParetoFrontTest, AWrongEstimateOfFramesNeverMakesAPlanLongerThanItSays) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  request.estimate_frames = [](const Measurement&) { return FrameRange{0, 100}; };
  const auto made = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(made.ok()) << made.status();
  for (const ParetoPoint& point : made->front.points) {
    double seconds = 0;
    for (const Measurement& scan : ScansOf(point)) seconds += ClusterGainModel::Wide(scan) ? 10 : 3;
    EXPECT_NEAR(point.time.Total_s(), seconds, 1e-9);
  }
}

TEST(MakeParetoFrontTest, HasNoDominatedPointsAndTheirNumbersAreThoseOfTheirScans) {
  FunctionGainModel gain_model = CastingGainModel(200, 1);
  const ParetoRequest request = CastingRequest();
  const auto made = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(made.ok()) << made.status();
  const std::vector<ParetoPoint>& points = made->front.points;
  ASSERT_GT(points.size(), 3u);
  for (const ParetoPoint& a : points) {
    for (const ParetoPoint& b : points) EXPECT_FALSE(Dominates(a, b));
    const std::vector<Measurement> scans = ScansOf(a);
    const auto exact = gain_model.ExactCoverage(scans);
    TargetBits covered(gain_model.measurable().size());
    std::vector<FrameRange> frames;
    for (const ScanCoverage& scan : *exact) {
      EXPECT_EQ(scan.feasibility, ScanFeasibility::kFeasible);
      covered |= scan.covered;
      frames.push_back({scan.first_frame, scan.last_frame});
    }
    EXPECT_EQ(a.score.satisfied, covered.Count());
    EXPECT_EQ(a.reaches_goal, covered.Count() >= 160);
    EXPECT_EQ(a.time.Total_s(),
              TimeOfPlan(request.execution, request.scan_step_m, scans, frames, 0).Total_s());
  }
  // More scans and seconds never give less.
  const auto most_within = [&](size_t scans, double seconds) {
    int64_t most = 0;
    for (const ParetoPoint& point : points) {
      if (point.scans.size() <= scans && point.time.Total_s() <= seconds) {
        most = std::max(most, point.Claimed());
      }
    }
    return most;
  };
  const ParetoPoint& last = points.back();
  EXPECT_GT(most_within(last.scans.size(), 1e9), most_within(1, 1e9));
  EXPECT_GT(most_within(100, 1e9), most_within(100, points.front().time.Total_s()));
}

TEST(MakeParetoFrontTest, ReachesTheGoalWithNoMoreScansThanThePlanAlone) {
  for (const int64_t seed : {1, 2, 3}) {
    FunctionGainModel gain_model = CastingGainModel(200, 1);
    ParetoRequest request = CastingRequest();
    request.plan.seed = seed;
    const auto plan = MakePlan(gain_model, request.plan);
    const auto made = MakeParetoFront(gain_model, request);
    ASSERT_TRUE(plan.ok() && made.ok());
    ASSERT_EQ(plan->stop_reason, StopReason::kGoalReached);
    const auto chosen = PointForGoal(made->front.points);
    ASSERT_TRUE(chosen.has_value());
    EXPECT_TRUE(made->front.points[*chosen].reaches_goal);
    EXPECT_LE(made->front.points[*chosen].scans.size(), plan->scans.size());
  }
}

TEST(MakeParetoFrontTest, WithoutCostsItIsScansAgainstSettledTargets) {
  FunctionGainModel gain_model = CastingGainModel(200, 1);
  ParetoRequest request = CastingRequest();
  request.execution = {};
  const auto made = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(made.ok()) << made.status();
  const std::vector<ParetoPoint>& points = made->front.points;
  EXPECT_EQ(points[0].scans.size(), 1u);
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].time.Total_s(), 0);
    if (i == 0) continue;
    EXPECT_GT(points[i].scans.size(), points[i - 1].scans.size());
    EXPECT_GT(points[i].Claimed(), points[i - 1].Claimed());
  }
}

TEST(MakeParetoFrontTest, SameSeedSameFront) {
  ParetoRequest request = CastingRequest();
  request.plan.evaluations_per_scan = 500;
  FunctionGainModel a = CastingGainModel(150, 1), b = CastingGainModel(150, 1);
  const auto first = MakeParetoFront(a, request), second = MakeParetoFront(b, request);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(ScansOf(first->front), ScansOf(second->front));
  EXPECT_EQ(first->evaluations, second->evaluations);
  request.plan.seed = 2;
  const auto other = MakeParetoFront(a, request);
  ASSERT_TRUE(other.ok());
  EXPECT_NE(ScansOf(first->front), ScansOf(other->front));
}

TEST(MakeParetoFrontTest, LockedScansAreInEveryPoint) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  Measurement locked;
  locked.camera_distance_m = 0.3;
  locked.offset_y_m = 0.25;
  request.plan.locked = {locked};
  const auto made = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(made.ok()) << made.status();
  for (const ParetoPoint& point : made->front.points) {
    EXPECT_EQ(point.scans[0].measurement, locked);
    EXPECT_TRUE(point.scans[0].locked);
  }
  using Point = std::tuple<size_t, int64_t, int64_t>;
  EXPECT_THAT(Objectives(made->front),
              ElementsAre(Point{1, 10, 20}, Point{2, 13, 30}, Point{2, 20, 40}, Point{3, 16, 40}));
}

TEST(MakeParetoFrontTest, WorksWhereOnlyWholePlansAreScored) {
  ShareGainModel gain_model;
  ParetoRequest request;
  request.plan.domain = OffsetDomain();
  request.plan.goal.admissible = 0.9;
  request.plan.evaluations_per_scan = 500;
  request.execution.costs.reposition_time_s = 5;
  request.time_limits = 4;
  const auto made = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(made.ok()) << made.status();
  // Three scans satisfy what all of them see; six satisfy all.
  const auto chosen = PointForGoal(made->front.points);
  ASSERT_TRUE(chosen.has_value());
  EXPECT_TRUE(made->front.points[*chosen].reaches_goal);
  for (const ParetoPoint& point : made->front.points) {
    EXPECT_GE(point.scans.size(), 1u);
    EXPECT_EQ(point.score.satisfied, gain_model.ScorePlan(ScansOf(point), true)->satisfied);
  }
}

TEST(MakeParetoFrontTest, InterruptedItIsTheFrontSoFar) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  const auto whole = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(whole.ok());
  std::atomic<bool> interrupted{false};
  int queries = 0;
  gain_model.set_on_query([&] { interrupted = ++queries > 160; });
  request.plan.interrupted = &interrupted;
  const auto part = MakeParetoFront(gain_model, request);
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_EQ(part->stop_reason, StopReason::kInterrupted);
  EXPECT_FALSE(part->front.points.empty());
  EXPECT_LT(part->evaluations, whole->evaluations);
}

TEST(MakeParetoFrontTest, InterruptedBeforeThereIsAPlanIsCancelled) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  const std::atomic<bool> interrupted{true};
  request.plan.interrupted = &interrupted;
  EXPECT_EQ(MakeParetoFront(gain_model, request).status().code(), absl::StatusCode::kCancelled);
}

TEST(MakeParetoFrontTest, TimeIsUpForAllOfIt) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  request.plan.goal.max_time_s = 1e-9;
  const auto made = MakeParetoFront(gain_model, request);
  EXPECT_EQ(made.status().code(), absl::StatusCode::kCancelled) << made.status();
}

TEST(MakeParetoFrontTest, AnEmptyFrontSaysWhy) {
  ClusterGainModel gain_model;
  gain_model.set_feasibility([](const Measurement&) { return ScanFeasibility::kCollision; });
  const auto none = MakeParetoFront(gain_model, ClusterRequest());
  EXPECT_EQ(none.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(none.status().message()), HasSubstr("no feasible scan"));

  FunctionGainModel nothing(0, [](const Measurement&, size_t) { return true; });
  const auto empty = MakeParetoFront(nothing, ClusterRequest());
  EXPECT_EQ(empty.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(empty.status().message()), HasSubstr("no measurable target"));
}

TEST(MakeParetoFrontTest, RefusesWhatItCannotDo) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  request.plan.strategy = "matrix";
  EXPECT_THAT(std::string(MakeParetoFront(gain_model, request).status().message()),
              HasSubstr("\"matrix\""));
  request = ClusterRequest();
  request.time_limits = -1;
  EXPECT_EQ(MakeParetoFront(gain_model, request).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(MakeParetoFrontTest, TellsOfItsProgress) {
  ClusterGainModel gain_model;
  ParetoRequest request = ClusterRequest();
  double last = 0;
  int calls = 0;
  request.on_progress = [&](double fraction, const std::string& text) {
    EXPECT_GE(fraction, 0);
    EXPECT_LE(fraction, 1);
    EXPECT_FALSE(text.empty());
    last = fraction;
    ++calls;
  };
  ASSERT_TRUE(MakeParetoFront(gain_model, request).ok());
  EXPECT_GT(calls, 3);
  EXPECT_GT(last, 0.5);
}

}  // namespace
}  // namespace sightline
