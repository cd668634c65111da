// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/detection_noise.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace sightline {
namespace {

constexpr int kTerms = 6;
constexpr double kFewestFound = 100;
constexpr int kGridSteps = 6;
constexpr int kMostIterations = 50;
constexpr double kConverged = 1e-10;
// Limit of ln sigma^2 and logit a; no number of columns could distinguish values beyond it.
constexpr double kMostLinear = 30;
// A line found as badly is uninformative; an inspection's table states no more
// (core/uncertainty/uncertainty_model.cpp).
constexpr double kLargestDeviationPx = 100;
// Precision of the first coefficient's prior: next to nothing, but every line may be found.
constexpr double kIntercept = 1e-4;

using Terms = Eigen::Matrix<double, kTerms, 1>;
using TermsMatrix = Eigen::Matrix<double, kTerms, kTerms>;

// Mean and standard deviation of a coordinate, weighted; a deviation of 0 is taken for 1.
struct Scale {
  double mean = 0, deviation = 1;
  double operator()(double value) const { return (value - mean) / deviation; }
};

template <typename Coordinate>
Scale ScaleOf(std::span<const DetectedBlock> blocks, const Coordinate& coordinate) {
  double weight = 0, sum = 0, squares = 0;
  for (const DetectedBlock& block : blocks) {
    weight += block.crossings;
    sum += block.crossings * coordinate(block);
  }
  Scale scale;
  scale.mean = sum / weight;
  for (const DetectedBlock& block : blocks) {
    const double off = coordinate(block) - scale.mean;
    squares += block.crossings * off * off;
  }
  const double deviation = std::sqrt(squares / weight);
  if (deviation > 1e-9 * std::max(1e-3, std::abs(scale.mean))) scale.deviation = deviation;
  return scale;
}

Terms TermsAt(double x, double y) {
  Terms terms;
  terms << 1, x, x * x, y, y * y, x * y;
  return terms;
}

// A generalised linear model in the terms.
struct Fit {
  Terms coefficients = Terms::Zero();
  TermsMatrix covariance = TermsMatrix::Zero();
  double dispersion = 1;

  double Variance(const Terms& terms) const { return terms.dot(covariance * terms); }
};

// `respond(block, linear, &residual, &information)`: at a value of the linear predictor, the
// derivative of the log-likelihood and the expected negative second one; returns the squared
// Pearson residual.
template <typename Respond>
Fit FitTerms(std::span<const DetectedBlock> blocks, const std::vector<Terms>& terms, double start,
             const Respond& respond) {
  TermsMatrix prior = TermsMatrix::Identity();
  prior(0, 0) = kIntercept;
  Fit fit;
  fit.coefficients[0] = start;
  // The dispersion changes the weight of the prior, so the fit is repeated with it.
  for (int pass = 0; pass < 3; ++pass) {
    TermsMatrix precision = prior;
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
      precision = prior;
      Terms slope = -(prior * fit.coefficients);
      for (size_t b = 0; b < blocks.size(); ++b) {
        const double linear = std::clamp(terms[b].dot(fit.coefficients), -kMostLinear, kMostLinear);
        double residual = 0, information = 0;
        respond(blocks[b], linear, &residual, &information);
        slope += residual / fit.dispersion * terms[b];
        precision += information / fit.dispersion * terms[b] * terms[b].transpose();
      }
      const Terms step = precision.ldlt().solve(slope);
      // Logarithms: a step of more than one is beyond where the model is straight.
      fit.coefficients += step / std::max(1.0, step.cwiseAbs().maxCoeff());
      if (step.squaredNorm() < kConverged) break;
    }
    fit.covariance = precision.ldlt().solve(TermsMatrix::Identity());
    double pearson = 0, counted = 0;
    for (size_t b = 0; b < blocks.size(); ++b) {
      const double linear = std::clamp(terms[b].dot(fit.coefficients), -kMostLinear, kMostLinear);
      double residual = 0, information = 0;
      const double squared = respond(blocks[b], linear, &residual, &information);
      if (!(information > 0)) continue;
      pearson += squared;
      counted += 1;
    }
    fit.dispersion = std::max(1.0, pearson / std::max(1.0, counted - kTerms));
  }
  return fit;
}

std::vector<double> Axis(std::vector<std::pair<double, double>> value_and_weight) {
  std::sort(value_and_weight.begin(), value_and_weight.end());
  double total = 0;
  for (const auto& [value, weight] : value_and_weight) total += weight;
  const auto quantile = [&](double share) {
    double sum = 0;
    for (const auto& [value, weight] : value_and_weight) {
      sum += weight;
      if (sum >= share * total) return value;
    }
    return value_and_weight.back().first;
  };
  const double low = quantile(0.01), high = quantile(0.99);
  if (!(high - low > 1e-6)) return {low};
  std::vector<double> axis;
  for (int i = 0; i < kGridSteps; ++i) axis.push_back(low + (high - low) * i / (kGridSteps - 1));
  return axis;
}

}  // namespace

std::optional<DetectionNoise> LearnDetectionNoise(std::span<const DetectedBlock> all) {
  std::vector<DetectedBlock> blocks;
  for (const DetectedBlock& block : all) {
    if (block.crossings > 0) blocks.push_back(block);
  }
  double found = 0, deviation = 0, crossings = 0;
  for (const DetectedBlock& block : blocks) {
    crossings += block.crossings;
    found += block.found;
    deviation += block.deviation_px;
  }
  if (found < kFewestFound) return std::nullopt;
  DetectionNoise noise;
  noise.bias_px = deviation / found;
  const auto about_mean = [&](const DetectedBlock& block) {
    const double bias = noise.bias_px;
    return std::max(
        0.0, block.deviation2_px2 - 2 * bias * block.deviation_px + block.found * bias * bias);
  };
  double squares = 0;
  for (const DetectedBlock& block : blocks) squares += about_mean(block);
  if (!(squares > 0)) return std::nullopt;

  const Scale x = ScaleOf(blocks, [](const DetectedBlock& b) { return b.distance_m; });
  const Scale y = ScaleOf(blocks, [](const DetectedBlock& b) { return b.incidence_rad; });
  std::vector<Terms> terms;
  for (const DetectedBlock& block : blocks) {
    terms.push_back(TermsAt(x(block.distance_m), y(block.incidence_rad)));
  }
  const Fit deviations = FitTerms(
      blocks, terms, std::log(squares / found),
      [&](const DetectedBlock& block, double linear, double* residual, double* information) {
        if (!(block.found > 0)) return 0.0;
        const double ratio = about_mean(block) / (block.found * std::exp(linear));
        *residual = 0.5 * block.found * (ratio - 1);
        *information = 0.5 * block.found;
        return 0.5 * block.found * (ratio - 1) * (ratio - 1);
      });
  // Half a miss keeps the start finite where every crossing is found.
  const double share = std::min(found, crossings - 0.5) / crossings;
  const Fit shares = FitTerms(
      blocks, terms, std::log(share / (1 - share)),
      [](const DetectedBlock& block, double linear, double* residual, double* information) {
        const double a = 1 / (1 + std::exp(-linear));
        *residual = block.found - block.crossings * a;
        *information = block.crossings * a * (1 - a);
        return *residual * *residual / std::max(1e-12, *information);
      });
  noise.deviation_dispersion = deviations.dispersion;
  noise.found_dispersion = shares.dispersion;

  std::vector<std::pair<double, double>> distances, angles;
  for (const DetectedBlock& block : blocks) {
    distances.emplace_back(block.distance_m, block.crossings);
    angles.emplace_back(block.incidence_rad, block.crossings);
  }
  noise.distances_m = Axis(std::move(distances));
  noise.incidence_angles_rad = Axis(std::move(angles));
  for (const double distance : noise.distances_m) {
    for (const double angle : noise.incidence_angles_rad) {
      const Terms at = TermsAt(x(distance), y(angle));
      const double a = 1 / (1 + std::exp(-at.dot(shares.coefficients)));
      // In a corner of the grid that no block comes from, squares of the terms may lead anywhere.
      noise.u_px.push_back(std::min(std::exp(0.5 * at.dot(deviations.coefficients)) / std::sqrt(a),
                                    kLargestDeviationPx));
      // ln u = (ln sigma^2 - ln a) / 2, and d ln a / d logit a = 1 - a.
      noise.relative_standard_error.push_back(
          0.5 * std::sqrt(deviations.Variance(at) + (1 - a) * (1 - a) * shares.Variance(at)));
    }
  }
  return noise;
}

}  // namespace sightline
