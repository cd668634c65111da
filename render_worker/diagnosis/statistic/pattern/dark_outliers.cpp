// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/dark_outliers.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/statistics/normal_distribution.h"

namespace sightline {

namespace {

// Residual below which a pixel is never an outlier. Chosen: noise would have to exceed 4.5 standard
// deviations.
constexpr double kImpossible = 0.5;
// Probability below which a pixel's contribution to the covariance is left out.
constexpr double kNegligibleProbability = 1e-12;

// Probability that noise of unit variance makes a pixel an outlier.
double OutlierProbability(double residual) { return NormalUpperTail(kDarkOutlier - residual); }

// A pixel that may be an outlier of the longest exposure.
struct Outlier {
  size_t pixel;
  double in_longest;        // probability to be one there
  Eigen::VectorXd in_both;  // and in every other frame; 0 for the longest exposure itself
};

std::vector<Outlier> PossibleOutliers(const std::vector<Image<double>>& frames, size_t longest) {
  std::vector<Outlier> outliers;
  for (size_t i = 0; i < frames[longest].values.size(); ++i) {
    if (frames[longest].values[i] < kImpossible) continue;
    Outlier outlier = {i, OutlierProbability(frames[longest].values[i]), {}};
    outlier.in_both = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(frames.size()));
    for (size_t f = 0; f < frames.size(); ++f) {
      if (f == longest) continue;
      outlier.in_both[static_cast<Eigen::Index>(f)] =
          outlier.in_longest * OutlierProbability(frames[f].values[i]);
    }
    outliers.push_back(std::move(outlier));
  }
  return outliers;
}

// Mean product of every pixel's clipped residuals over pairs of frames.
std::vector<double> PixelProducts(const std::vector<Image<double>>& frames) {
  std::vector<double> products(frames.front().values.size());
  for (size_t i = 0; i < products.size(); ++i) {
    double values = 0, own = 0;
    for (const Image<double>& frame : frames) {
      const double value = ClippedResidual(frame.values[i]);
      values += value;
      own += value * value;
    }
    products[i] =
        (values * values - own) / static_cast<double>(frames.size() * (frames.size() - 1));
  }
  return products;
}

}  // namespace

double ClippedResidual(double residual) { return std::clamp(residual, -kDarkLimit, kDarkLimit); }

Eigen::VectorXd OutlierCounts(const std::vector<Image<double>>& frames, size_t longest) {
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(frames.size()));
  for (const Outlier& outlier : PossibleOutliers(frames, longest)) counts += outlier.in_both;
  return counts;
}

Eigen::MatrixXd CovarianceOfRealisations(const std::vector<Image<double>>& frames, size_t longest) {
  const auto count = static_cast<Eigen::Index>(frames.size());
  const auto area = static_cast<double>(frames.front().values.size());
  const std::vector<double> products = PixelProducts(frames);
  double sum = 0, squares = 0;
  for (double product : products) {
    sum += product;
    squares += product * product;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(1 + count, 1 + count);
  covariance(0, 0) = (squares - sum * sum / area) / (area * area);
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(count);
  for (const Outlier& outlier : PossibleOutliers(frames, longest)) {
    counts += outlier.in_both;
    if (outlier.in_longest < kNegligibleProbability) continue;
    covariance.block(1, 0, count, 1) += outlier.in_both * (products[outlier.pixel] / area);
    covariance.bottomRightCorner(count, count) +=
        outlier.in_both * outlier.in_both.transpose() / outlier.in_longest;
    covariance.diagonal().tail(count) +=
        outlier.in_both - outlier.in_both.cwiseAbs2() / outlier.in_longest;
  }
  covariance.block(1, 0, count, 1) -= counts * (sum / (area * area));
  // Derivative of the Anscombe transform.
  const Eigen::VectorXd slopes = (counts.array() + kAnscombe).rsqrt();
  covariance.bottomRightCorner(count, count) =
      slopes.asDiagonal() * covariance.bottomRightCorner(count, count) * slopes.asDiagonal();
  covariance.block(1, 0, count, 1) = slopes.asDiagonal() * covariance.block(1, 0, count, 1);
  covariance.block(0, 1, 1, count) = covariance.block(1, 0, count, 1).transpose();
  return covariance;
}

}  // namespace sightline
