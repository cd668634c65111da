// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/line_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "core/laser_line/merge_exposures.h"

namespace sightline {
namespace {

LinePoint At(int column, double row, bool saturated = false) {
  return LinePoint{.column_px = column, .row_px = row, .saturated = saturated};
}

LineSums Total(const std::vector<LineSums>& blocks) {
  LineSums total;
  for (const LineSums& block : blocks) total += block;
  return total;
}

// Numbers by hand: deviations 0.5 and -0.5, one missed crossing, one false line.
TEST(CompareLine, CountsWhatIsFoundMissedAndFalse) {
  const std::vector<LineCrossing> line = {{0, 10}, {1, 10}, {2, 10}};
  const std::vector<LinePoint> detected = {At(0, 10.5), At(1, 9.5), At(1, 30)};
  const LineSums sums = Total(CompareLine(detected, line, 4, 2, 9));
  EXPECT_EQ(sums.columns, 4);
  EXPECT_EQ(sums.crossings, 3);
  EXPECT_EQ(sums.found, 2);
  EXPECT_EQ(sums.false_lines, 1);
  const LineQuality quality = QualityOf(sums, {});
  EXPECT_DOUBLE_EQ(quality.bias_px, 0);
  EXPECT_DOUBLE_EQ(quality.rms_px, 0.5);
  EXPECT_DOUBLE_EQ(quality.u_px, std::sqrt(0.5));
  EXPECT_DOUBLE_EQ(quality.profile_coverage, 2.0 / 3);
  EXPECT_DOUBLE_EQ(quality.false_lines_per_column, 0.25);
  // Thesis eq. 6.5 with u_pr = 3.
  EXPECT_DOUBLE_EQ(quality.cost, 2.0 / 3 * std::sqrt(0.5) + 1.0 / 3 * 3);
  EXPECT_DOUBLE_EQ(QualityOf(sums, {3, 2}).cost, quality.cost + 2 * 3 * 0.25);
}

// Two crossings of one column and two points: each point belongs to one of them.
TEST(CompareLine, PairsNearestFirstAndEachOnce) {
  const std::vector<LineCrossing> line = {{0, 10}, {0, 14}};
  const LineSums sums = Total(CompareLine({At(0, 11), At(0, 12.5)}, line, 1, 1, 9));
  EXPECT_EQ(sums.found, 2);
  // 11 to 10 and 12.5 to 14, not 12.5 to 10.
  EXPECT_DOUBLE_EQ(sums.deviation_px, 1 - 1.5);
  const LineSums one = Total(CompareLine({At(0, 11), At(0, 11.5)}, {{0, 10}}, 1, 1, 9));
  EXPECT_EQ(one.found, 1);
  EXPECT_EQ(one.false_lines, 1);
  EXPECT_DOUBLE_EQ(one.deviation_px, 1);
}

TEST(CompareLine, BlocksAddUpWhateverTheirSize) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> row(0, 50);
  std::vector<LineCrossing> line;
  std::vector<LinePoint> detected;
  for (int column = 0; column < 100; ++column) {
    if (column % 3 != 0) line.push_back({column, row(random)});
    for (int i = 0; i < column % 4; ++i) detected.push_back(At(column, row(random)));
  }
  const LineSums whole = Total(CompareLine(detected, line, 100, 100, 9));
  for (const int block : {1, 7, 32}) {
    const LineSums sums = Total(CompareLine(detected, line, 100, block, 9));
    EXPECT_EQ(sums.found, whole.found);
    EXPECT_EQ(sums.false_lines, whole.false_lines);
    EXPECT_NEAR(sums.deviation2_px2, whole.deviation2_px2, 1e-9);
  }
  EXPECT_EQ(whole.found + whole.false_lines, static_cast<double>(detected.size()));
}

TEST(QualityOf, NothingFoundCostsThePriorUncertainty) {
  const LineSums sums = Total(CompareLine({}, {{0, 1}, {1, 1}}, 2, 2, 9));
  EXPECT_DOUBLE_EQ(QualityOf(sums, {}).cost, 3);
  EXPECT_DOUBLE_EQ(QualityOf(sums, {}).u_px, 3);
}

// Points that are clipped beyond the permitted part count as not found.
TEST(QualityOf, ClippedPointsBeyondTheLimitCountAsMissed) {
  LineSums sums;
  sums.columns = sums.crossings = 100;
  sums.found = 80;
  sums.clipped = 40;
  sums.deviation2_px2 = 20;
  const LineQuality without = QualityOf(sums, {}), with = QualityOf(sums, {3, 0, 0.1});
  EXPECT_DOUBLE_EQ(with.clipped_fraction, 0.5);
  EXPECT_DOUBLE_EQ(without.cost, 0.8 * without.u_px + 0.2 * 3);
  // The limit lets 60 % of the 80 points count: 50 % are clipped, 10 % may be.
  EXPECT_DOUBLE_EQ(with.cost, 0.48 * with.u_px + 0.52 * 3);
  EXPECT_DOUBLE_EQ(QualityOf(sums, {3, 0, 0.5}).cost, without.cost);
}

// Sums of blocks as images would give them: deviations normal, a share of the crossings missed, a
// share of the found ones clipped.
std::vector<LineSums> DrawImage(std::mt19937& random, int blocks, double deviation, double bias,
                                double found, double clipped = 0) {
  std::normal_distribution<double> normal(bias, deviation);
  std::bernoulli_distribution is_found(found);
  std::vector<LineSums> sums;
  for (int b = 0; b < blocks; ++b) {
    LineSums s;
    s.columns = s.crossings = 32;
    for (int i = 0; i < 32; ++i) {
      if (!is_found(random)) continue;
      const double d = normal(random);
      s.found += 1;
      if (clipped > 0) s.clipped += std::bernoulli_distribution(clipped)(random) ? 1 : 0;
      s.deviation_px += d;
      s.deviation2_px2 += d * d;
    }
    sums.push_back(s);
  }
  return sums;
}

std::vector<std::vector<LineSums>> Transposed(const std::vector<std::vector<LineSums>>& images) {
  std::vector<std::vector<LineSums>> blocks(images[0].size());
  for (const std::vector<LineSums>& image : images) {
    for (size_t b = 0; b < blocks.size(); ++b) blocks[b].push_back(image[b]);
  }
  return blocks;
}

// The stated intervals hold new images in 95 of 100 cases, from few realisations.
class Intervals : public ::testing::TestWithParam<int> {};
TEST_P(Intervals, HoldFreshImages) {
  const int realisations = GetParam();
  std::mt19937 random(7);
  int u = 0, coverage = 0, bias = 0, cost = 0, rms = 0;
  constexpr int kTrials = 1000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<std::vector<LineSums>> images;
    for (int r = 0; r < realisations; ++r) images.push_back(DrawImage(random, 40, 0.5, 0.1, 0.9));
    const QualityEstimate estimate(Transposed(images), {});
    const LineQuality fresh = QualityOf(Total(DrawImage(random, 40, 0.5, 0.1, 0.9)), {});
    const auto holds = [](const QualityEstimate::Interval& i, double value) {
      return value >= i.lower && value <= i.upper ? 1 : 0;
    };
    u += holds(estimate.u_px(), fresh.u_px);
    bias += holds(estimate.bias_px(), fresh.bias_px);
    rms += holds(estimate.rms_px(), fresh.rms_px);
    coverage += holds(estimate.profile_coverage(), fresh.profile_coverage);
    cost += holds(estimate.cost(), fresh.cost);
  }
  // 95 % -+ 4 binomial standard errors, and a little for so few realisations.
  for (const int count : {u, bias, rms, coverage, cost}) {
    EXPECT_GT(count, 915) << realisations;
    EXPECT_LT(count, 980) << realisations;
  }
}
INSTANTIATE_TEST_SUITE_P(Realisations, Intervals, ::testing::Values(2, 4, 8));

// The standard error of the mean cost is the scatter of mean costs.
class CostError : public ::testing::TestWithParam<LineCost> {};
TEST_P(CostError, StandardErrorIsTheScatterOfTheMean) {
  std::mt19937 random(11);
  double sum = 0, squares = 0, variance = 0;
  constexpr int kTrials = 600;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<std::vector<LineSums>> images;
    for (int r = 0; r < 4; ++r) images.push_back(DrawImage(random, 30, 0.6, 0, 0.8, 0.3));
    const QualityEstimate estimate(Transposed(images), GetParam());
    sum += estimate.mean().cost;
    squares += estimate.mean().cost * estimate.mean().cost;
    variance += estimate.CostStandardError() * estimate.CostStandardError();
  }
  const double scatter = std::sqrt(squares / kTrials - sum * sum / kTrials / kTrials);
  EXPECT_NEAR(std::sqrt(variance / kTrials) / scatter, 1, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Limits, CostError, ::testing::Values(LineCost{}, LineCost{3, 0, 0.1}));

// Chance that two settings share cancels in their difference.
TEST(QualityEstimate, SharedChanceCancelsInDifferences) {
  std::mt19937 random(5);
  std::vector<std::vector<LineSums>> a, b;
  for (int r = 0; r < 4; ++r) {
    a.push_back(DrawImage(random, 30, 0.5, 0, 0.9));
    // The same image, every deviation a tenth larger.
    b.push_back(a.back());
    for (LineSums& s : b.back()) {
      s.deviation_px *= 1.1;
      s.deviation2_px2 *= 1.21;
    }
  }
  const QualityEstimate first(Transposed(a), {}), second(Transposed(b), {});
  const double independent = std::hypot(first.CostStandardError(), second.CostStandardError());
  EXPECT_LT(first.StandardErrorOfDifference(second), 0.3 * independent);
  EXPECT_EQ(first.StandardErrorOfDifference(first), 0);
}

TEST(QualityEstimate, FullCoverageStillLeavesRoom) {
  std::mt19937 random(1);
  std::vector<std::vector<LineSums>> images;
  for (int r = 0; r < 2; ++r) images.push_back(DrawImage(random, 10, 0.5, 0, 1));
  const QualityEstimate estimate(Transposed(images), {});
  EXPECT_EQ(estimate.mean().profile_coverage, 1);
  // Two misses in 320 are not ruled out by none in two images, three are: 1/9 and 1/27.
  EXPECT_NEAR(estimate.profile_coverage().lower, 1 - 2.0 / 320, 1e-12);
  EXPECT_EQ(estimate.profile_coverage().upper, 1);
}

// Bright places from the short exposure, dark ones from the long one, none twice.
TEST(MergeExposures, TakesClippedPointsFromTheShortOne) {
  const std::vector<LinePoint> long_exposure = {At(0, 10, true), At(1, 10), At(2, 10, true)};
  const std::vector<LinePoint> short_exposure = {At(0, 10.2), At(1, 10.4), At(4, 7)};
  const std::vector<LinePoint> merged = MergeExposures(long_exposure, short_exposure, 3);
  ASSERT_EQ(merged.size(), 4U);
  EXPECT_EQ(merged[0].row_px, 10.2);  // clipped in the long one
  EXPECT_EQ(merged[1].row_px, 10);    // not clipped: the long one is better
  EXPECT_EQ(merged[2].row_px, 10);    // clipped, but the short one has nothing
  EXPECT_EQ(merged[3].column_px, 4);  // only in the short one
}

}  // namespace
}  // namespace sightline
