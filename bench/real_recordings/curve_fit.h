// SPDX-License-Identifier: Apache-2.0
// Fits curves with prior beliefs about their parameters and compares models by evidence.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace sightline {

// Normal prior; wide where the recordings' description says nothing.
struct CurveParameter {
  std::string name;
  double mean = 0;
  double standard_deviation = 1;
  double step = 1e-3;  // for differences
  double lower = -std::numeric_limits<double>::infinity();
};

struct CurveData {
  Eigen::VectorXd observed;
  Eigen::VectorXd standard_deviation;
  std::vector<bool> held_out;
};

using Curve = std::function<Eigen::VectorXd(const Eigen::VectorXd& parameters)>;

struct CurveFit {
  Eigen::VectorXd parameters, standard_errors, curve;
  double chi_squared = 0, held_out_chi_squared = 0;
  int count = 0, held_out_count = 0;
  // Laplace's approximation, of the points used for the fit [nats].
  double log_evidence = 0;
};

// Levenberg and Marquardt's method; points held out are not looked at.
inline CurveFit FitCurve(const Curve& curve, const std::vector<CurveParameter>& parameters,
                         const CurveData& data) {
  const auto n = static_cast<Eigen::Index>(parameters.size());
  Eigen::VectorXd x(n), mean(n), precision(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const CurveParameter& parameter = parameters[static_cast<size_t>(k)];
    x[k] = mean[k] = parameter.mean;
    precision[k] = 1 / (parameter.standard_deviation * parameter.standard_deviation);
  }
  Eigen::VectorXd weight = data.standard_deviation.cwiseAbs2().cwiseInverse();
  for (Eigen::Index i = 0; i < weight.size(); ++i) {
    if (data.held_out[static_cast<size_t>(i)]) weight[i] = 0;
  }
  const auto cost = [&](const Eigen::VectorXd& at, const Eigen::VectorXd& values) {
    return 0.5 * weight.dot((data.observed - values).cwiseAbs2()) +
           0.5 * precision.dot((at - mean).cwiseAbs2());
  };
  Eigen::VectorXd values = curve(x);
  double current = cost(x, values), damping = 1e-3;
  Eigen::MatrixXd hessian(n, n);
  for (int iteration = 0; iteration < 40; ++iteration) {
    Eigen::MatrixXd jacobian(values.size(), n);
    for (Eigen::Index k = 0; k < n; ++k) {
      Eigen::VectorXd moved = x;
      moved[k] += parameters[static_cast<size_t>(k)].step;
      jacobian.col(k) = (curve(moved) - values) / parameters[static_cast<size_t>(k)].step;
    }
    hessian = jacobian.transpose() * weight.asDiagonal() * jacobian;
    hessian.diagonal() += precision;
    if (n == 0) break;
    const Eigen::VectorXd gradient =
        jacobian.transpose() * weight.cwiseProduct(data.observed - values) -
        precision.cwiseProduct(x - mean);
    bool better = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      Eigen::MatrixXd damped = hessian;
      damped.diagonal() *= 1 + damping;
      Eigen::VectorXd next = x + damped.ldlt().solve(gradient);
      for (Eigen::Index k = 0; k < n; ++k) {
        next[k] = std::max(next[k], parameters[static_cast<size_t>(k)].lower);
      }
      const Eigen::VectorXd next_values = curve(next);
      const double next_cost = cost(next, next_values);
      better = next_cost < current;
      if (better) {
        gain = current - next_cost;
        x = next;
        values = next_values;
        current = next_cost;
        damping *= 0.2;
      } else {
        damping *= 6;
      }
    }
    if (!better || gain < 1e-4) break;
  }
  CurveFit fit;
  fit.parameters = x;
  fit.curve = values;
  fit.standard_errors = Eigen::VectorXd::Zero(n);
  if (n > 0) {
    const Eigen::LDLT<Eigen::MatrixXd> normal(hessian);
    fit.standard_errors = normal.solve(Eigen::MatrixXd::Identity(n, n)).diagonal().cwiseSqrt();
    fit.log_evidence -= 0.5 * normal.vectorD().array().log().sum();
    fit.log_evidence += 0.5 * precision.array().log().sum();
  }
  fit.log_evidence -= current;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double z = (data.observed[i] - values[i]) / data.standard_deviation[i];
    if (data.held_out[static_cast<size_t>(i)]) {
      fit.held_out_chi_squared += z * z;
      ++fit.held_out_count;
    } else {
      fit.chi_squared += z * z;
      ++fit.count;
      fit.log_evidence -= std::log(data.standard_deviation[i]) + 0.918938533204673;
    }
  }
  return fit;
}

// One line on stdout: how well it fits, what it predicts, and its parameters.
inline void PrintFit(const std::string& name, const CurveFit& fit,
                     const std::vector<CurveParameter>& parameters) {
  std::printf("%-46s chi^2/n %9.2f (%d)  held-out %9.2f (%d)  log evidence %10.1f", name.c_str(),
              fit.chi_squared / fit.count, fit.count, fit.held_out_chi_squared / fit.held_out_count,
              fit.held_out_count, fit.log_evidence);
  for (size_t k = 0; k < parameters.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    std::printf("  %s %.4g +- %.2g", parameters[k].name.c_str(), fit.parameters[i],
                fit.standard_errors[i]);
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace sightline
