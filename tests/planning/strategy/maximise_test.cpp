// SPDX-License-Identifier: Apache-2.0
#include "planning/optimise/maximise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

struct Recorder {
  int64_t evaluations = 0;
  size_t smallest_batch = 1000000;
  std::vector<std::vector<double>> points;

  BatchObjective Wrap(std::function<double(const std::vector<double>&)> f) {
    return [this,
            f](std::span<const std::vector<double>> batch) -> absl::StatusOr<std::vector<double>> {
      evaluations += static_cast<int64_t>(batch.size());
      smallest_batch = std::min(smallest_batch, batch.size());
      std::vector<double> values;
      for (const auto& x : batch) {
        points.push_back(x);
        values.push_back(f(x));
      }
      return values;
    };
  }
};

// Maximum 0 at a point away from the centre.
double Bowl(const std::vector<double>& x) {
  double sum = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const double c = 0.2 + 0.6 * static_cast<double>(i) / 8;
    sum -= (x[i] - c) * (x[i] - c);
  }
  return sum;
}

const char* Name(Method method) {
  switch (method) {
    case Method::kParticleSwarm:
      return "ParticleSwarm";
    case Method::kGeneticAlgorithm:
      return "GeneticAlgorithm";
    case Method::kSimulatedAnnealing:
      return "SimulatedAnnealing";
    case Method::kCmaEs:
      return "CmaEs";
    case Method::kDifferentialEvolution:
      return "DifferentialEvolution";
  }
  return "";
}

class MaximiseTest : public testing::TestWithParam<Method> {
 protected:
  MaximiseOptions Options() const {
    MaximiseOptions options;
    if (GetParam() == Method::kSimulatedAnnealing) {
      options.step = 0.05;
      options.start_temperature = 0.05;
      options.population = 10;
    }
    return options;
  }
};

TEST_P(MaximiseTest, FindsTheMaximumOfABowlWithinTheBudgetInBatches) {
  Recorder recorder;
  const auto result = Maximise(GetParam(), 9, recorder.Wrap(Bowl), 10000, 5, Options());
  ASSERT_TRUE(result.ok()) << result.status();
  // A random search of 10 000 points stays below -0.1 on average.
  EXPECT_GT(result->value, -0.02);
  EXPECT_DOUBLE_EQ(result->value, Bowl(result->x));
  EXPECT_LE(recorder.evaluations, 10000);
  EXPECT_GE(recorder.evaluations, 9800);
  // One by one would be a batch of 1: the recorded generations were all replayed.
  EXPECT_GE(recorder.smallest_batch, 10u);
  double best = -1e300;
  for (const auto& x : recorder.points) {
    for (double coordinate : x) {
      EXPECT_GE(coordinate, 0);
      EXPECT_LE(coordinate, 1);
    }
    best = std::max(best, Bowl(x));
  }
  EXPECT_DOUBLE_EQ(result->value, best);
}

TEST_P(MaximiseTest, SameSeedSamePointsOtherSeedOtherPoints) {
  Recorder a, b, c;
  ASSERT_TRUE(Maximise(GetParam(), 4, a.Wrap(Bowl), 1000, 7, Options()).ok());
  ASSERT_TRUE(Maximise(GetParam(), 4, b.Wrap(Bowl), 1000, 7, Options()).ok());
  ASSERT_TRUE(Maximise(GetParam(), 4, c.Wrap(Bowl), 1000, 8, Options()).ok());
  EXPECT_EQ(a.points, b.points);
  EXPECT_NE(a.points, c.points);
}

TEST_P(MaximiseTest, FindsAMaximumAtTheSeamOfAPeriodicAxis) {
  Recorder recorder;
  MaximiseOptions options = Options();
  options.periodic = {true, false};
  const auto result = Maximise(GetParam(), 2, recorder.Wrap([](const std::vector<double>& x) {
    return std::cos(2 * std::numbers::pi * x[0]) - 4 * (x[1] - 0.4) * (x[1] - 0.4);
  }),
                               3000, 3, options);
  ASSERT_TRUE(result.ok());
  EXPECT_GT(result->value, 0.99);
  bool crossed = false;
  for (const auto& x : recorder.points) {
    EXPECT_GE(x[0], -0.5);
    EXPECT_LE(x[0], 1.5);
    EXPECT_GE(x[1], 0);
    EXPECT_LE(x[1], 1);
    crossed |= x[0] < 0 || x[0] > 1;
  }
  if (GetParam() != Method::kSimulatedAnnealing) {
    EXPECT_TRUE(crossed);
  }
}

TEST_P(MaximiseTest, RestartsShareTheEvaluations) {
  Recorder recorder;
  MaximiseOptions options = Options();
  options.restarts = 5;
  ASSERT_TRUE(Maximise(GetParam(), 3, recorder.Wrap(Bowl), 2000, 1, options).ok());
  EXPECT_LE(recorder.evaluations, 2000);
  EXPECT_GE(recorder.evaluations, 1000);
}

TEST_P(MaximiseTest, SmallBudgetsAreKept) {
  for (int64_t budget : {1, 2, 6, 7, 13, 51}) {
    Recorder recorder;
    const auto result = Maximise(GetParam(), 3, recorder.Wrap(Bowl), budget, 1, Options());
    ASSERT_TRUE(result.ok()) << budget;
    EXPECT_LE(recorder.evaluations, budget);
    EXPECT_GE(recorder.evaluations, 1);
  }
}

TEST_P(MaximiseTest, NothingToSearchIsOneEvaluation) {
  Recorder recorder;
  const auto result = Maximise(
      GetParam(), 0, recorder.Wrap([](const std::vector<double>&) { return 3.0; }), 100, 1);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->value, 3);
  EXPECT_EQ(recorder.evaluations, 1);
}

TEST_P(MaximiseTest, PassesTheObjectivesErrorOn) {
  int calls = 0;
  const auto result = Maximise(
      GetParam(), 3,
      [&](std::span<const std::vector<double>> batch) -> absl::StatusOr<std::vector<double>> {
        if (++calls == 3) return absl::UnavailableError("server is gone");
        return std::vector<double>(batch.size(), 1.0);
      },
      5000, 1, Options());
  EXPECT_EQ(result.status(), absl::UnavailableError("server is gone"));
  EXPECT_EQ(calls, 3);
}

TEST_P(MaximiseTest, StartsFromGivenPoints) {
  Recorder recorder;
  MaximiseOptions options = Options();
  options.start = {{0.25, 0.5}, {0.75, 0.125}};
  ASSERT_TRUE(Maximise(GetParam(), 2, recorder.Wrap(Bowl), 500, 1, options).ok());
  EXPECT_EQ(recorder.points[0], options.start[0]);
  EXPECT_EQ(recorder.points[1], options.start[1]);
}

INSTANTIATE_TEST_SUITE_P(All, MaximiseTest,
                         testing::Values(Method::kParticleSwarm, Method::kGeneticAlgorithm,
                                         Method::kSimulatedAnnealing, Method::kCmaEs,
                                         Method::kDifferentialEvolution),
                         [](const auto& instance) { return std::string(Name(instance.param)); });

// Many local maxima; the global one is 0 at 0.5.
double Rastrigin(const std::vector<double>& x) {
  double sum = 0;
  for (double coordinate : x) {
    const double y = 8 * (coordinate - 0.5);
    sum -= y * y + 10 * (1 - std::cos(2 * std::numbers::pi * y));
  }
  return sum;
}

TEST(ParticleSwarmTest, LeavesLocalMaxima) {
  // The local maxima next to the global one have the value -1.
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Recorder recorder;
    MaximiseOptions options;
    options.restarts = 2;
    const auto result =
        Maximise(Method::kParticleSwarm, 3, recorder.Wrap(Rastrigin), 10000, seed, options);
    ASSERT_TRUE(result.ok());
    EXPECT_GT(result->value, -0.5) << seed;
  }
}

TEST(SimulatedAnnealingTest, ColdChainsOnlyClimb) {
  MaximiseOptions options;
  options.population = 1;
  options.step = 0.02;
  options.start_temperature = 1e-12;
  std::vector<double> values;
  Recorder recorder;
  ASSERT_TRUE(Maximise(Method::kSimulatedAnnealing, 2, recorder.Wrap(Bowl), 300, 4, options).ok());
  // Each proposal lies near the best point so far, the chain's present place.
  std::vector<double> best = recorder.points[0];
  for (const auto& x : recorder.points) {
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(x[i], best[i], 6 * 0.02);
    if (Bowl(x) > Bowl(best)) best = x;
  }
  EXPECT_GT(Bowl(best), Bowl(recorder.points[0]));
}

}  // namespace
}  // namespace sightline
