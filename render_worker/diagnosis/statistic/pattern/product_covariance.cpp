// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/product_covariance.h"

#include <algorithm>
#include <cmath>

namespace sightline {

namespace {

// Correlation below which pixels count as independent. Chosen: products of two such are 1e-4.
constexpr double kNegligibleCorrelation = 0.01;

// Correlation of two pixels some rows and columns apart.
struct CorrelationAtLag {
  int rows, columns;
  double value;
};

std::vector<CorrelationAtLag> CorrelatedLags(const ResidualCorrelation& correlation) {
  std::vector<CorrelationAtLag> lags;
  const int most = correlation.speckle->max_lag();
  for (int r = -most; r <= most; ++r) {
    for (int c = -most; c <= most; ++c) {
      const double value = correlation.At(r, c);
      if (value > kNegligibleCorrelation) lags.push_back({r, c, value});
    }
  }
  return lags;
}

// Sum over k of R_a(k) R_b(k + (rows, columns)).
double Overlap(const std::vector<CorrelationAtLag>& a, const ResidualCorrelation& b, int rows,
               int columns) {
  double sum = 0;
  for (const CorrelationAtLag& l : a) sum += l.value * b.At(l.rows + rows, l.columns + columns);
  return sum;
}

}  // namespace

std::vector<ResidualCorrelation> CorrelationsOfResiduals(const ExpectedSet& expected,
                                                         const std::vector<int>& frames,
                                                         const std::vector<RowWeights>& weights) {
  std::vector<ResidualCorrelation> correlations;
  for (size_t i = 0; i < frames.size(); ++i) {
    const ExpectedFrame& sample = expected.strips[expected.strips.size() / 2][frames[i]];
    const auto best = std::max_element(weights[i].begin(), weights[i].end()) - weights[i].begin();
    const int row = static_cast<int>(best / 2), parity = static_cast<int>(best % 2);
    const double mean = sample.MeanDn(row, parity);
    double levels = 0;
    for (const Image<float>& level : sample.level_dn) {
      levels +=
          std::pow(level.At(row, parity) - mean, 2) / static_cast<double>(sample.level_dn.size());
    }
    correlations.push_back(
        {levels / (levels + sample.noise_variance_dn2.At(row, parity)), &sample.SpeckleAt(row)});
  }
  return correlations;
}

Eigen::MatrixXd CovarianceOfProducts(const std::vector<ResidualCorrelation>& correlations,
                                     const std::vector<RowWeights>& weights, const LagValues& total,
                                     int columns_px) {
  std::vector<std::vector<CorrelationAtLag>> near;
  for (const ResidualCorrelation& correlation : correlations) {
    near.push_back(CorrelatedLags(correlation));
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kLagCount, kLagCount);
  const auto add_pair = [&](size_t a, size_t b, double product) {
    for (int l = 0; l < kLagCount; ++l) {
      for (int m = l; m < kLagCount; ++m) {
        const double value = 0.5 * product *
                             (Overlap(near[a], correlations[b], kLags[m].rows - kLags[l].rows,
                                      kLags[m].columns - kLags[l].columns) +
                              Overlap(near[a], correlations[b], kLags[m].rows + kLags[l].rows,
                                      kLags[m].columns + kLags[l].columns));
        covariance(l, m) += value;
      }
    }
  };
  for (size_t a = 0; a < correlations.size(); ++a) {
    for (size_t b = a + 1; b < correlations.size(); ++b) {
      double product = 0;
      for (size_t i = 0; i < weights[a].size(); ++i) product += weights[a][i] * weights[b][i];
      product *= columns_px / 2.0;
      if (product != 0) add_pair(a, b, product);
    }
  }
  for (int l = 0; l < kLagCount; ++l) {
    for (int m = l; m < kLagCount; ++m) {
      const double totals = total[l] * total[m];
      covariance(l, m) = totals > 0 ? covariance(l, m) / totals : 0;
      covariance(m, l) = covariance(l, m);
    }
  }
  return covariance;
}

double VarianceBySensitivity(double prnu_squared, int l, const RowWeights& sum,
                             const std::vector<RowWeights>& weights) {
  double variance = 0;
  for (size_t i = 0; i < sum.size(); ++i) {
    double squares = 0, mixed = 0;
    for (const RowWeights& each : weights) {
      squares += each[i] * each[i];
      mixed += each[i] * std::pow(sum[i] - each[i], 2);
    }
    const double pairs = 0.5 * (sum[i] * sum[i] - squares);
    variance +=
        prnu_squared * mixed + (l == 0 ? 2 : 1) * prnu_squared * prnu_squared * pairs * pairs;
  }
  return variance;
}

}  // namespace sightline
