// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/pair_products.h"

namespace sightline {

RowWeights SumOfWeights(const std::vector<RowWeights>& each) {
  RowWeights sum(each.front().size(), 0);
  for (const RowWeights& values : each) {
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += values[i];
  }
  return sum;
}

double PairWeight(const RowWeights& sum, const std::vector<RowWeights>& each, int row, int parity,
                  const Lag& lag) {
  const size_t here = 2 * row + parity;
  const size_t there = 2 * (row + lag.rows) + (parity + lag.columns) % 2;
  double value = sum[here] * sum[there];
  for (const RowWeights& weights : each) value -= weights[here] * weights[there];
  return 0.5 * value;
}

LagValues TotalWeights(const RowWeights& sum, const std::vector<RowWeights>& each,
                       const RegionOfInterest& roi) {
  LagValues total{};
  for (int l = 0; l < kLagCount; ++l) {
    for (int row = 0; row + kLags[l].rows < roi.rows_px; ++row) {
      for (int parity = 0; parity < 2; ++parity) {
        total[l] +=
            PairWeight(sum, each, row, parity, kLags[l]) * (roi.columns_px - kLags[l].columns) / 2;
      }
    }
  }
  return total;
}

LagValues Autocovariance(const Image<double>& pattern, int first_row, const RowWeights& sum,
                         const std::vector<RowWeights>& each) {
  LagValues values{};
  for (int l = 0; l < kLagCount; ++l) {
    double weights = 0;
    for (int row = 0; row + kLags[l].rows < pattern.rows_px; ++row) {
      for (int parity = 0; parity < 2; ++parity) {
        const double weight = PairWeight(sum, each, first_row + row, parity, kLags[l]);
        if (weight == 0) continue;
        for (int c = parity; c + kLags[l].columns < pattern.columns_px; c += 2) {
          values[l] +=
              weight * pattern.At(row, c) * pattern.At(row + kLags[l].rows, c + kLags[l].columns);
          weights += weight;
        }
      }
    }
    if (weights > 0) values[l] /= weights;
  }
  return values;
}

}  // namespace sightline
