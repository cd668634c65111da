// SPDX-License-Identifier: Apache-2.0
#include "render_worker/speckle/integrated_speckle.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/memo/memo.h"

namespace sightline {

namespace {

// Below, eigenvalues lie so close that their sum cancels: it is the Gamma law that passes into the
// sum in between.
constexpr double kLeastSum = 0.05, kWholeSum = 0.1;

// Integrals of the law's density times x^0, x^1, x^2 from 0 to x.
struct Moments {
  double share = 0, mean = 0, square = 0;
};

// Sum of exponential variables of geometric scales: a sum of exponentials again.
class GeometricSum {
 public:
  explicit GeometricSum(double contrast_squared) {
    const double ratio = (1 - contrast_squared) / (1 + contrast_squared);
    constexpr double kLeast = 1e-9;
    for (double scale = 1 - ratio; scale > kLeast * (1 - ratio); scale *= ratio) {
      scales_.push_back(scale);
    }
    for (size_t k = 0; k < scales_.size(); ++k) {
      double weight = 1;
      for (size_t j = 0; j < scales_.size(); ++j) {
        if (j != k) weight /= 1 - scales_[j] / scales_[k];
      }
      weights_.push_back(weight);
    }
  }

  Moments Below(double x) const {
    Moments sum;
    for (size_t k = 0; k < scales_.size(); ++k) {
      const double scale = scales_[k], rest = std::exp(-x / scale);
      sum.share += weights_[k] * (1 - rest);
      sum.mean += weights_[k] * (scale - (x + scale) * rest);
      sum.square +=
          weights_[k] * (2 * scale * scale - (x * x + 2 * scale * x + 2 * scale * scale) * rest);
    }
    return sum;
  }

  double Quantile(double share) const {
    constexpr double kFarthest = 60;
    constexpr int kBits = 36;
    const auto beyond = [&](double x) {
      double below = 0;
      for (size_t k = 0; k < scales_.size(); ++k) {
        below += weights_[k] * (1 - std::exp(-x / scales_[k]));
      }
      return below - share;
    };
    std::uintmax_t evaluations = 100;
    const auto [low, high] = boost::math::tools::toms748_solve(
        beyond, 0.0, kFarthest, -share, 1 - share, boost::math::tools::eps_tolerance<double>(kBits),
        evaluations);
    return 0.5 * (low + high);
  }

 private:
  std::vector<double> scales_, weights_;
};

class Gamma {
 public:
  explicit Gamma(double contrast_squared) : shape_(1 / contrast_squared) {}

  // Integrated by parts: P(a + 1, x) = P(a, x) - x^a exp(-x) / Gamma(a + 1).
  Moments Below(double x) const {
    const double y = shape_ * x, share = boost::math::gamma_p(shape_, y, Policy());
    const double density = boost::math::gamma_p_derivative(shape_, y, Policy());
    const double mean = share - y / shape_ * density;
    const double square = mean - y / shape_ * density * y / (shape_ + 1);
    return {share, mean, square * (shape_ + 1) / shape_};
  }

  double Quantile(double share) const {
    return boost::math::gamma_p_inv(shape_, share, Policy()) / shape_;
  }

 private:
  // Plain double: long double costs several times as much.
  using Policy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;
  double shape_;
};

template <typename Law>
std::vector<double> Levels(const Law& law, double contrast_squared, int count) {
  std::vector<double> levels;
  Moments below;
  for (int i = 1; i <= count - 2; ++i) {
    const Moments end = law.Below(law.Quantile(static_cast<double>(i) / count));
    levels.push_back((end.mean - below.mean) * count);
    below = end;
  }
  const double mean = 0.5 * count * (1 - below.mean);
  const double square = 0.5 * count * (1 + contrast_squared - below.square);
  const double deviation = std::sqrt(std::max(0.0, square - mean * mean));
  levels.push_back(mean - deviation);
  levels.push_back(mean + deviation);
  return levels;
}

std::vector<double> ComputeLevels(double contrast_squared, int count) {
  const double part =
      std::clamp((contrast_squared - kLeastSum) / (kWholeSum - kLeastSum), 0.0, 1.0);
  std::vector<double> levels(count, 0.0);
  const auto add = [&](double weight, const auto& law) {
    const std::vector<double> of_law = Levels(law, contrast_squared, count);
    for (int i = 0; i < count; ++i) levels[i] += weight * of_law[i];
  };
  if (part < 1) add(1 - part, Gamma(contrast_squared));
  if (part > 0) add(part, GeometricSum(contrast_squared));
  return levels;
}

}  // namespace

std::vector<double> SpeckleLevels(double contrast_squared, int count) {
  if (contrast_squared <= 0 || count < 2) return std::vector<double>(count, 1.0);
  // Between levels that are kept, in steps of the contrast.
  constexpr int kSteps = 256;
  static auto* const known =
      new Memo<std::pair<int, int>, std::vector<double>>(static_cast<size_t>(16 * kSteps));
  const double place = kSteps * std::sqrt(contrast_squared);
  const int step = std::min(static_cast<int>(place), kSteps - 1);
  const auto at = [&](int i) {
    if (i == 0) return std::vector<double>(count, 1.0);
    const double contrast = static_cast<double>(i) / kSteps;
    return known->Get({i, count}, [&] { return ComputeLevels(contrast * contrast, count); });
  };
  std::vector<double> levels = at(step);
  const std::vector<double> next = at(step + 1);
  double variance = 0;
  for (int i = 0; i < count; ++i) {
    levels[i] += (place - step) * (next[i] - levels[i]);
    variance += (levels[i] - 1) * (levels[i] - 1) / count;
  }
  // To the law's variance: the means of the lower intervals lack what is within.
  const double stretch = std::sqrt(contrast_squared / variance);
  for (double& level : levels) level = std::max(0.0, 1 + stretch * (level - 1));
  return levels;
}

}  // namespace sightline
