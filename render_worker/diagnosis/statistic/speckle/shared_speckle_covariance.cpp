// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/speckle/shared_speckle_covariance.h"

#include <algorithm>
#include <cmath>

namespace sightline {

namespace {

// Relative error of the variance ratio. Chosen: the model's noise is Gaussian and the sensor's is
// Poisson noise.
constexpr double kVarianceError = 0.01;
// Relative error of what moving speckle adds to the variance ratio. Chosen, as for repeats
// (repeat_statistic.cpp).
constexpr double kMotionError = 0.2;
// Variance of a variance ratio that is uninformative; it is 1 where speckle does not move.
constexpr double kUninformativeRatio = 1e4;
// Variance of the mean of saturated pixels [DN^2]: half a raw value for what the levels of speckle
// do not resolve. The largest value itself is exact.
constexpr double kSaturatedVariance_dn2 = 0.25;

// Pixels of a component: recorded ones if known, else expected ones.
double SeenPixels(const SharedSpeckleBlock& block, int component, double expected) {
  return block.observed_count.empty() ? expected : block.observed_count[component];
}

// Variance of component k of pair i, which is component `at + k` of the block.
double VarianceOfComponent(const SharedSpeckleBlock& block, const SharedSpeckleMoments& moments,
                           size_t i, int at, int k, double top_dn) {
  const ExposurePair& pair = block.pairs[i];
  const double count = moments.count[at + k];
  const double seen = SeenPixels(block, at + k, count);
  if (std::min(seen, count) < kFewPixelsOfBin) {
    return k == pair.variance_ratio() ? kUninformativeRatio : top_dn * top_dn;
  }
  if (k == pair.saturated()) return kSaturatedVariance_dn2;
  if (k == pair.variance_ratio()) {
    const double excess = moments.sum[at + k] / count - 1;
    return 2 / seen + kVarianceError * kVarianceError +
           std::pow(kMotionError * std::max(0.0, excess), 2);
  }
  // If speckle has moved, values regress to the mean, by at most this.
  const double signal = 0.5 * (pair.edges_dn[k] + pair.edges_dn[k + 1]) - 2 * pair.offset_dn;
  const double regression = moments.decorrelation[i] * pair.ratio * std::abs(pair.ratio - 1) /
                            std::pow(1 + pair.ratio, 2);
  return moments.noise[at + k] / (count * seen) + std::pow(regression * signal, 2);
}

// Covariance of the bins of pair i with those of the next pair, by the recording in both.
void AddCommonNoise(const SharedSpeckleBlock& block, const SharedSpeckleMoments& moments, size_t i,
                    int at, Eigen::MatrixXd& covariance) {
  constexpr double kFewest = kFewPixelsOfBin * kFewPixelsOfBin;
  const int next = at + block.pairs[i].size();
  for (int a = 0; a < block.pairs[i].bins(); ++a) {
    for (int b = 0; b < block.pairs[i + 1].bins(); ++b) {
      const double counts = moments.count[at + a] * moments.count[next + b];
      if (counts < kFewest) continue;
      double seen = counts;
      if (!block.observed_count.empty()) {
        seen = block.observed_count[at + a] * block.observed_count[next + b];
      }
      if (seen < kFewest) continue;
      covariance(at + a, next + b) = moments.common[i](a, b) / std::max(counts, seen);
      covariance(next + b, at + a) = covariance(at + a, next + b);
    }
  }
}

// All pixels of a row share its random offset. The rows of a recording are in its own pair and in
// the next one.
void AddRowOffsets(const ExpectedSet& expected, const SharedSpeckleBlock& block,
                   const SharedSpeckleMoments& moments, Eigen::MatrixXd& covariance) {
  const std::vector<ExpectedFrame>& samples = expected.strips.front();
  const auto shared_rows = [&](int k, int l) {
    const double counts = moments.count[k] * moments.count[l];
    return counts > 0 ? moments.of_rows.row(k).dot(moments.of_rows.row(l)) / counts : 0;
  };
  int at = 0;
  for (size_t i = 0; i < block.pairs.size(); ++i) {
    const ExposurePair& pair = block.pairs[i];
    const double variance =
        RowOffsetVariance(samples[pair.first], samples[pair.second], pair.ratio);
    for (int k = 0; k < pair.bins(); ++k) {
      for (int l = 0; l < pair.bins(); ++l) {
        covariance(at + k, at + l) += variance * shared_rows(at + k, at + l);
      }
    }
    // The variance ratio contains as many squared offsets as there are rows.
    const int of_variance = at + pair.variance_ratio();
    covariance(of_variance, of_variance) += 2 * shared_rows(of_variance, of_variance);
    const int next = at + pair.size();
    if (i + 1 < block.pairs.size()) {
      const ExposurePair& other = block.pairs[i + 1];
      const double both = -other.ratio * std::pow(samples[pair.second].row_scatter_dn, 2);
      for (int k = 0; k < pair.bins(); ++k) {
        for (int l = 0; l < other.bins(); ++l) {
          covariance(at + k, next + l) += both * shared_rows(at + k, next + l);
          covariance(next + l, at + k) = covariance(at + k, next + l);
        }
      }
    }
    at = next;
  }
}

}  // namespace

Eigen::MatrixXd SharedSpeckleCovariance(const ExpectedSet& expected,
                                        const SharedSpeckleBlock& block,
                                        const SharedSpeckleMoments& moments) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(block.size, block.size);
  int at = 0;
  for (size_t i = 0; i < block.pairs.size(); ++i) {
    const ExposurePair& pair = block.pairs[i];
    const double top_dn = expected.strips.front()[pair.second].frame.sensor.largest_dn();
    for (int k = 0; k < pair.size(); ++k) {
      covariance(at + k, at + k) = VarianceOfComponent(block, moments, i, at, k, top_dn);
    }
    if (i + 1 < block.pairs.size()) AddCommonNoise(block, moments, i, at, covariance);
    at += pair.size();
  }
  if (moments.of_rows.size() > 0) AddRowOffsets(expected, block, moments, covariance);
  return covariance;
}

}  // namespace sightline
