// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/speckle/shared_speckle_statistic.h"

#include "render_worker/diagnosis/statistic/speckle/shared_speckle_covariance.h"
#include "render_worker/diagnosis/statistic/speckle/shared_speckle_moments.h"

namespace sightline {

namespace {

// Expected pixels below which a component counts as empty.
constexpr double kNoPixels = 1e-6;

// Components of one pair, from its two images.
Eigen::VectorXd ObservePair(const ExposurePair& pair, const std::vector<uint16_t>& a,
                            const std::vector<uint16_t>& b) {
  const int bins = pair.bins();
  std::vector<double> count(bins, 0), sum(bins, 0), square(bins, 0), weights(bins, 0);
  double saturated = 0, saturated_sum = 0;
  for (size_t p = 0; p < a.size(); ++p) {
    if (a[p] >= pair.saturated_dn) {
      ++saturated;
      saturated_sum += b[p];
    }
    const double sum_dn = static_cast<double>(a[p]) + b[p];
    const int bin = pair.BinOf(sum_dn);
    if (bin < 0) continue;
    const double difference = b[p] - pair.ratio * a[p];
    // Bins are wide, so each pixel is divided by its own nominal variance.
    const double weight = 1 / pair.NominalVariance(sum_dn);
    ++count[bin];
    sum[bin] += difference;
    square[bin] += difference * difference * weight;
    weights[bin] += weight;
  }
  Eigen::VectorXd values = Eigen::VectorXd::Zero(pair.size());
  double spread = 0, pixels = 0;
  for (int bin = 0; bin < bins; ++bin) {
    if (count[bin] == 0) continue;
    const double mean = sum[bin] / count[bin];
    values[bin] = mean;
    if (count[bin] < kFewPixelsOfBin) continue;
    // Sum of w (d - m)^2 about the bin's mean m; the cross term takes the mean weight.
    spread += square[bin] - mean * mean * weights[bin];
    pixels += count[bin] - 1;
  }
  values[pair.saturated()] = saturated > 0 ? saturated_sum / saturated : 0;
  values[pair.variance_ratio()] = pixels > 0 ? spread / pixels : 1;
  return values;
}

// Value of component k of a pair without pixels: that of a linear sensor without noise.
double EmptyValue(const ExposurePair& pair, int k) {
  if (k == pair.saturated()) return 0;
  if (k == pair.variance_ratio()) return 1;
  return pair.offset_dn * (1 - pair.ratio);
}

}  // namespace

int SharedSpeckleStatistic::FrameOfComponent(int block, int component) const {
  const std::vector<ExposurePair>& pairs = blocks_[block].pairs;
  return pairs[component / pairs.front().size()].second;
}

Eigen::VectorXd SharedSpeckleStatistic::Observed(const RecordedSet& set, int index) const {
  const SharedSpeckleBlock& block = blocks_[index];
  Eigen::VectorXd values = Eigen::VectorXd::Zero(block.size);
  int at = 0;
  for (const ExposurePair& pair : block.pairs) {
    values.segment(at, pair.size()) = ObservePair(pair, set.frames[pair.first].raw_dn.values,
                                                  set.frames[pair.second].raw_dn.values);
    at += pair.size();
  }
  return values;
}

Eigen::VectorXd SharedSpeckleStatistic::Expected(const ExpectedSet& expected, int index) const {
  const SharedSpeckleBlock& block = blocks_[index];
  const SharedSpeckleMoments moments = ExpectSharedSpeckle(expected, block, false);
  Eigen::VectorXd values(block.size);
  int at = 0;
  for (const ExposurePair& pair : block.pairs) {
    for (int k = 0; k < pair.size(); ++k, ++at) {
      values[at] =
          moments.count[at] > kNoPixels ? moments.sum[at] / moments.count[at] : EmptyValue(pair, k);
    }
  }
  return values;
}

Eigen::MatrixXd SharedSpeckleStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const SharedSpeckleBlock& block = blocks_[index];
  return SharedSpeckleCovariance(expected, block, ExpectSharedSpeckle(expected, block, true));
}

}  // namespace sightline
