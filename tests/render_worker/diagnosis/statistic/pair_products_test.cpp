// SPDX-License-Identifier: Apache-2.0
// Mean products of pairs of recordings, against sums over all pairs and pixels.
#include "render_worker/diagnosis/statistic/pattern/pair_products.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace sightline {
namespace {

constexpr int kColumns = 40, kRows = 5;

// Weights of three recordings that differ between rows and columns.
std::vector<RowWeights> ThreeRecordings() {
  std::vector<RowWeights> each(3, RowWeights(2 * kRows));
  for (size_t f = 0; f < each.size(); ++f) {
    for (size_t i = 0; i < each[f].size(); ++i) {
      each[f][i] = 1 + 0.3 * std::sin(1.7 * static_cast<double>(i) + static_cast<double>(f));
    }
  }
  return each;
}

double WeightAt(const RowWeights& weights, int row, int column) {
  return weights[2 * static_cast<size_t>(row) + static_cast<size_t>(column) % 2];
}

TEST(PairProducts, TotalWeightsAreTheSumOverPairsAndPixels) {
  const std::vector<RowWeights> each = ThreeRecordings();
  const LagValues total = TotalWeights(SumOfWeights(each), each, {0, 0, kColumns, kRows});
  for (int l = 0; l < kLagCount; ++l) {
    double sum = 0;
    for (int row = 0; row + kLags[l].rows < kRows; ++row) {
      for (int c = 0; c + kLags[l].columns < kColumns; ++c) {
        for (size_t a = 0; a < each.size(); ++a) {
          for (size_t b = 0; b < each.size(); ++b) {
            if (a == b) continue;
            sum += 0.5 * WeightAt(each[a], row, c) *
                   WeightAt(each[b], row + kLags[l].rows, c + kLags[l].columns);
          }
        }
      }
    }
    EXPECT_NEAR(total[l], sum, 1e-9 * sum) << l;
  }
}

TEST(PairProducts, AutocovarianceOfAPatternWithAPeriod) {
  const std::vector<RowWeights> each = ThreeRecordings();
  // A wave of 16 columns: its products over 0, 16 and 32 columns are equal, over 8 opposite.
  Image<double> pattern(kColumns + 24, kRows);
  for (int row = 0; row < kRows; ++row) {
    for (int c = 0; c < pattern.columns_px; ++c) pattern.At(row, c) = c % 16 < 8 ? 1 : -1;
  }
  const LagValues values = Autocovariance(pattern, 0, SumOfWeights(each), each);
  EXPECT_NEAR(values[0], 1, 1e-12);
  EXPECT_NEAR(values[2], 1, 1e-12);
  EXPECT_NEAR(values[3], -1, 1e-12);
  EXPECT_NEAR(values[4], 1, 1e-12);
  EXPECT_NEAR(values[5], 1, 1e-12);
}

}  // namespace
}  // namespace sightline
