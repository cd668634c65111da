// SPDX-License-Identifier: Apache-2.0
// The evidence of a law over its parameters, and what it has most probably drawn.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/scatter_evaluation.h"
#include "render_worker/diagnosis/random_effect/scatter_law.h"

namespace sightline {
namespace {

using std::numbers::pi;

// Of the variance that speckle and noise leave to a recording's amplitude, which the model's
// approximations make uncertain.
constexpr double kScatterError = 0.3;

}  // namespace

std::pair<Eigen::VectorXd, double> RecordingScatter::Remaining(
    const Linearisation& linear, const ScatterLaw& law, const std::vector<double>& parameters) {
  if (!law.within) return {linear.slope, linear.length};
  const Eigen::VectorXd more = law.within(parameters, linear.origin) - linear.within_origin;
  return {linear.slope - linear.within_cross * more,
          linear.length - 2 * more.dot(linear.within_slope) + more.dot(linear.within_inner * more)};
}

Eigen::MatrixXd RecordingScatter::Factor(const Linearisation& linear, const ScatterLaw& law,
                                         const std::vector<double>& parameters) const {
  const Eigen::MatrixXd factor = law.factor(parameters);
  Eigen::MatrixXd covariance = factor * factor.transpose();
  covariance.diagonal() += kScatterError * linear.inner.diagonal().cwiseMax(1e-6).cwiseInverse();
  return covariance.llt().matrixL();
}

double RecordingScatter::Gain(const Linearisation& linear, const ScatterLaw& law,
                              const std::vector<double>& parameters) const {
  const Eigen::MatrixXd factor = Factor(linear, law, parameters);
  const auto [slope, length] = Remaining(linear, law, parameters);
  Eigen::MatrixXd information = factor.transpose() * linear.inner * factor;
  information.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd gradient = factor.transpose() * slope;
  const double known = 2 * linear.information.matrixLLT().diagonal().array().log().sum();
  return 0.5 * (null_total_ - length + gradient.dot(solver.solve(gradient))) -
         solver.matrixLLT().diagonal().array().log().sum() - 0.5 * (known + linear.log_determinant);
}

// The evidence is integrated over a grid: logarithmic in the strength, in the shape's standardised
// scale.
RecordingScatter::Peak RecordingScatter::Search(const Linearisation& linear, const ScatterLaw& law,
                                                const Effect& effect) const {
  const std::vector<EffectParameter>& description = effect.description().parameters;
  const EffectParameter& strength = description[0];
  const bool shaped = description.size() > 1;
  struct Point {
    std::vector<double> parameters;
    double gain, log_weight;  // of the prior's mass
  };
  const auto grid = [&](double low, double high, double step, double shape_low, double shape_high,
                        double shape_step) {
    std::vector<Point> points;
    const int strengths = static_cast<int>(std::lround((high - low) / step)) + 1;
    const int shapes =
        shaped ? static_cast<int>(std::lround((shape_high - shape_low) / shape_step)) + 1 : 1;
    for (int j = 0; j < shapes; ++j) {
      double log_shape = 0, shape = 0;
      if (shaped) {
        const double z = shape_low + j * shape_step;
        shape = ParameterFromStandardised(description[1], z);
        log_shape = std::log(shape_step / (pi * (1 + z * z)));
      }
      for (int i = 0; i < strengths; ++i) {
        const double u = low + i * step, z = std::exp(u);
        std::vector<double> parameters = {std::min(strength.upper, strength.prior_scale * z)};
        if (shaped) parameters.push_back(shape);
        const double gain = Gain(linear, law, parameters);
        points.push_back(
            {std::move(parameters), gain, log_shape + std::log(step * z * 2 / (pi * (1 + z * z)))});
      }
    }
    return points;
  };
  const auto summarise = [&](const std::vector<Point>& points) {
    Peak peak;
    const Point* best = &points.front();
    double largest = -1e300;
    for (const Point& point : points) {
      largest = std::max(largest, point.gain + point.log_weight);
      if (point.gain > best->gain) best = &point;
    }
    double sum = 0;
    std::vector<double> square(description.size(), 0);
    for (const Point& point : points) {
      const double weight = std::exp(point.gain + point.log_weight - largest);
      sum += weight;
      for (size_t k = 0; k < square.size(); ++k) {
        square[k] += weight * std::pow(point.parameters[k] - best->parameters[k], 2);
      }
    }
    peak.parameters = best->parameters;
    peak.gain = best->gain;
    peak.log_evidence = largest + std::log(sum);
    for (double s : square) peak.standard_errors.push_back(std::sqrt(s / sum));
    return peak;
  };
  constexpr double kWeakest = -6;  // log of the strength over its scale
  const double strongest = std::log(strength.upper / strength.prior_scale);
  const double longest =
      shaped ? std::min(6.0, StandardisedParameter(
                                 description[1], std::min(law.largest_shape, description[1].upper)))
             : 0;
  Peak coarse = summarise(grid(kWeakest, std::min(strongest, 4.0), 0.4, -6, longest, 0.5));
  if (coarse.gain < 1) return coarse;
  if (law.amplitude == Amplitude::kShift) {
    // Whole periods in some exposure or other: many peaks along the frequency.
    const double near = std::log(coarse.parameters[0] / strength.prior_scale);
    const Peak finer = summarise(grid(std::max(kWeakest, near - 0.8),
                                      std::min(strongest, near + 0.8), 0.4, -6, longest, 0.05));
    if (finer.gain > coarse.gain) coarse = finer;
  }
  std::array<double, 2> best = {
      std::log(coarse.parameters[0] / strength.prior_scale),
      shaped ? StandardisedParameter(description[1], coarse.parameters[1]) : 0};
  const auto parameters_at = [&](const std::array<double, 2>& x) {
    std::vector<double> parameters = {
        std::min(strength.upper, strength.prior_scale * std::exp(x[0]))};
    if (shaped) parameters.push_back(ParameterFromStandardised(description[1], x[1]));
    return parameters;
  };
  const auto gain_at = [&](const std::array<double, 2>& x) {
    return Gain(linear, law, parameters_at(x));
  };
  double gain = coarse.gain;
  for (double step = 0.2; step > 2e-3; step /= 2) {
    for (bool moved = true; moved;) {
      moved = false;
      for (size_t k = 0; k < description.size(); ++k) {
        for (const double sign : {-1.0, 1.0}) {
          std::array<double, 2> next = best;
          next[k] += sign * step;
          next[0] = std::clamp(next[0], kWeakest, strongest);
          next[1] = std::min(next[1], longest);
          const double there = gain_at(next);
          if (!(there > gain + 1e-3)) continue;
          gain = there;
          best = next;
          moved = true;
        }
      }
    }
  }
  Peak fine = summarise(grid(std::max(kWeakest, best[0] - 0.6), std::min(strongest, best[0] + 0.6),
                             0.1, best[1] - 0.5, std::min(longest, best[1] + 0.5), 0.1));
  fine.parameters = parameters_at(best);
  fine.gain = gain;
  // A wide distribution is covered by the coarse grid only; a narrow one falls between the points,
  // but has a curvature.
  double laplace = gain;
  for (size_t k = 0; k < description.size(); ++k) {
    constexpr double kStep = 0.02;
    std::array<double, 2> less = best, more = best;
    less[k] -= kStep;
    more[k] += kStep;
    const double curvature = (2 * gain - gain_at(less) - gain_at(more)) / (kStep * kStep);
    const double slope = std::abs(parameters_at(more)[k] - parameters_at(less)[k]) / (2 * kStep);
    const double z = k == 0 ? std::exp(best[0]) : best[1];
    laplace += std::log((k == 0 ? 2 * z : 1) / (pi * (1 + z * z)) *
                        std::sqrt(2 * pi / std::max(1.0, curvature)));
    if (curvature > 1) {
      fine.standard_errors[k] = std::max(fine.standard_errors[k], slope / std::sqrt(curvature));
    }
  }
  fine.log_evidence = std::max({laplace, fine.log_evidence, coarse.log_evidence});
  return fine;
}

RecordingScatter::Posterior RecordingScatter::MostProbable(
    const Linearisation& linear, const ScatterLaw& law,
    const std::vector<double>& parameters) const {
  Posterior posterior;
  posterior.factor = Factor(linear, law, parameters);
  const Eigen::VectorXd slope = Remaining(linear, law, parameters).first;
  Eigen::MatrixXd information = posterior.factor.transpose() * linear.inner * posterior.factor;
  information.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  posterior.standardised_amplitudes = solver.solve(posterior.factor.transpose() * slope);
  posterior.amplitudes = posterior.factor * posterior.standardised_amplitudes;
  Eigen::VectorXd residual = linear.residual - linear.change * posterior.amplitudes;
  if (law.within)
    residual -= linear.within * (law.within(parameters, linear.origin) - linear.within_origin);
  posterior.parameters = linear.information.solve(linear.jacobian.transpose() * residual);
  for (size_t i = 0; i < null_.held.size(); ++i) {
    const auto held = static_cast<Eigen::Index>(i);
    if (null_.held[i]) posterior.parameters[held] = null_.standardised[held];
  }
  posterior.log_determinant = 2 * (solver.matrixLLT().diagonal().array().log().sum() +
                                   linear.information.matrixLLT().diagonal().array().log().sum());
  return posterior;
}

}  // namespace sightline
