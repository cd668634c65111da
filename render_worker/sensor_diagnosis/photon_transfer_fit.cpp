// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "render_worker/sensor_diagnosis/square.h"

namespace sightline {
namespace {

constexpr double kQuantisationVariance_dn2 = 1.0 / 12;
// Above it the saturation of single pixels takes variance away.
constexpr double kLargestShareOfSaturation = 0.9, kLargestClippedShare = 1e-6;
constexpr int kFewestBrightSteps = 6;
constexpr int kFolds = 4;
// Relative standard deviations from step to step that are considered.
constexpr double kLeastScatter = 1e-7, kLargestScatter = 0.1;
// Golden sections of one search bring its logarithm to 0.02; the searches of light and variance
// follow each other.
constexpr int kGoldenSections = 14, kSearchRounds = 3;
// Photon numbers written as whole numbers are off by a uniform law of width one.
const double kRoundingDeviation_photons = 1 / std::sqrt(12.0);

// The parameters of a model, each with a scale that brings it to the order of one.
struct Layout {
  int gain = -1, efficiency = -1, dark_current = -1, black_level = -1, dark_variance = -1;
  int quadratic = -1, cubic = -1, brighter_fatter = -1, time_offset = -1, stray = -1;
  std::vector<double> scale;
  std::vector<std::pair<std::string, std::string>> name_and_unit;
};

struct Observations {
  std::vector<const FlatFieldStatistics*> steps;
  std::vector<size_t> index;
  Eigen::VectorXd mean_dn, variance_dn2, noise_of_mean_dn, noise_of_variance_dn2;
  std::vector<double> photons;  // 0 of dark steps
  double saturation_electrons = 1;
  double black_level_dn = 0;
  double black_level_scatter_dn = 0;
  bool whole_photons = false;

  Eigen::Index size() const { return static_cast<Eigen::Index>(steps.size()); }
};

struct Expected {
  Eigen::VectorXd mean_dn, variance_dn2;
};

Expected Model(const Observations& data, const Layout& layout, const Eigen::VectorXd& scaled) {
  const auto at = [&](int k) { return k < 0 ? 0.0 : scaled[k] * layout.scale[k]; };
  const double gain = at(layout.gain), b_2 = at(layout.quadratic), b_3 = at(layout.cubic);
  const double time_offset_s = at(layout.time_offset), stray = at(layout.stray);
  const double brighter_fatter = at(layout.brighter_fatter);
  Expected expected{Eigen::VectorXd(data.size()), Eigen::VectorXd(data.size())};
  for (Eigen::Index i = 0; i < data.size(); ++i) {
    const FlatFieldStatistics& step = *data.steps[i];
    double photons = data.photons[i];
    if (!step.dark) {
      if (step.exposure_time_s > 0) photons *= 1 + time_offset_s / step.exposure_time_s;
      photons += stray;
    }
    const double electrons =
        at(layout.efficiency) * photons + at(layout.dark_current) * step.exposure_time_s;
    const double u = electrons / data.saturation_electrons;
    expected.mean_dn[i] = at(layout.black_level) + gain * electrons * (1 + b_2 * u + b_3 * u * u);
    const double slope = gain * (1 + 2 * b_2 * u + 3 * b_3 * u * u);
    expected.variance_dn2[i] =
        slope * slope * (electrons * (1 - brighter_fatter * u) + at(layout.dark_variance)) +
        kQuantisationVariance_dn2;
  }
  return expected;
}

// What steps differ by beyond temporal noise, as relative standard deviations.
struct StepScatter {
  double light = kLeastScatter, variance = kLeastScatter;
};

// Standard deviations of means and variances, with what steps differ by.
Eigen::VectorXd Deviations(const Observations& data, const StepScatter& scatter) {
  const Eigen::Index n = data.size();
  Eigen::VectorXd deviation(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double signal = std::abs(data.mean_dn[i] - data.black_level_dn);
    const FlatFieldStatistics& step = *data.steps[i];
    double variance =
        Square(data.noise_of_mean_dn[i]) + Square(data.black_level_scatter_dn) / step.frames();
    if (!step.dark) {
      variance += Square(scatter.light * signal);
      if (data.whole_photons && data.photons[i] > 0) {
        variance += Square(signal * kRoundingDeviation_photons / data.photons[i]);
      }
    }
    deviation[i] = std::sqrt(variance);
    deviation[n + i] =
        std::hypot(data.noise_of_variance_dn2[i], scatter.variance * data.variance_dn2[i]);
  }
  return deviation;
}

// What Eigen's minimiser asks for: weighted residuals and their number.
struct Residuals {
  using Scalar = double;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };
  using InputType = Eigen::VectorXd;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;

  int inputs() const { return static_cast<int>(layout.scale.size()); }
  int values() const { return static_cast<int>(2 * data.size()); }
  int operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residuals) const {
    const Expected expected = Model(data, layout, x);
    residuals.resize(2 * data.size());
    residuals << expected.mean_dn - data.mean_dn, expected.variance_dn2 - data.variance_dn2;
    residuals.array() /= deviation.array();
    return 0;
  }

  const Observations& data;
  const Layout& layout;
  const Eigen::VectorXd& deviation;
};

Eigen::MatrixXd Jacobian(const Residuals& residuals, const Eigen::VectorXd& x) {
  Eigen::MatrixXd jacobian(residuals.values(), residuals.inputs());
  Eigen::VectorXd above, below;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double step = 1e-5 * std::max(1.0, std::abs(x[k]));
    Eigen::VectorXd moved = x;
    moved[k] = x[k] + step;
    residuals(moved, above);
    moved[k] = x[k] - step;
    residuals(moved, below);
    jacobian.col(k) = (above - below) / (2 * step);
  }
  return jacobian;
}

struct Solution {
  Eigen::VectorXd x;
  StepScatter scatter;
  double log_likelihood = 0;
};

// Least squares at a given scatter of the steps; unset if it does not converge.
std::optional<Solution> Solve(const Observations& data, const Layout& layout,
                              const Eigen::VectorXd& start, const StepScatter& scatter) {
  const Eigen::VectorXd deviation = Deviations(data, scatter);
  const Residuals residuals{data, layout, deviation};
  Eigen::NumericalDiff<Residuals, Eigen::Central> differentiated(residuals);
  Eigen::LevenbergMarquardt<decltype(differentiated)> solver(differentiated);
  solver.parameters.maxfev = 4000;
  Solution solution{start, scatter, 0};
  const auto status = solver.minimize(solution.x);
  if (status == Eigen::LevenbergMarquardtSpace::ImproperInputParameters ||
      status == Eigen::LevenbergMarquardtSpace::TooManyFunctionEvaluation ||
      !solution.x.allFinite()) {
    return std::nullopt;
  }
  Eigen::VectorXd values;
  residuals(solution.x, values);
  solution.log_likelihood = -0.5 * values.squaredNorm() - deviation.array().log().sum();
  return solution;
}

// Maximum over the scatter of light and variance, too, by golden sections of their logarithms in
// turn.
std::optional<Solution> Maximise(const Observations& data, const Layout& layout,
                                 const Eigen::VectorXd& start) {
  constexpr double kGolden = std::numbers::phi - 1;
  std::optional<Solution> best;
  StepScatter scatter{1e-3, 1e-3};
  Eigen::VectorXd from = start;
  for (int round = 0; round < kSearchRounds; ++round) {
    for (double StepScatter::*searched : {&StepScatter::light, &StepScatter::variance}) {
      // Later rounds stay near what the one before found.
      const double centre = std::log(scatter.*searched), width = round == 0 ? 100 : 2;
      double low = std::max(std::log(kLeastScatter), centre - width);
      double high = std::min(std::log(kLargestScatter), centre + width);
      const auto value = [&](double log_scatter) {
        StepScatter at = scatter;
        at.*searched = std::exp(log_scatter);
        const auto solution = Solve(data, layout, from, at);
        if (!solution) return -std::numeric_limits<double>::infinity();
        if (!best || solution->log_likelihood > best->log_likelihood) {
          best = solution;
          from = solution->x;
        }
        return solution->log_likelihood;
      };
      double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
      double value_b = value(b), value_a = value(a);
      for (int i = 0; i < kGoldenSections; ++i) {
        if (value_a > value_b) {
          high = std::exchange(b, a);
          value_b = value_a;
          a = high - kGolden * (high - low);
          value_a = value(a);
        } else {
          low = std::exchange(a, b);
          value_a = value_b;
          b = low + kGolden * (high - low);
          value_b = value(b);
        }
      }
      if (best) scatter = best->scatter;
    }
  }
  return best;
}

struct Problem {
  Observations data;
  Layout layout;
  Eigen::VectorXd start;
};

void Fill(const std::vector<FlatFieldStatistics>& steps, Observations* data) {
  const Eigen::Index n = data->size();
  data->mean_dn.resize(n);
  data->variance_dn2.resize(n);
  data->noise_of_mean_dn.resize(n);
  data->noise_of_variance_dn2.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const FlatFieldStatistics& step = steps[data->index[i]];
    const Estimate& variance = *step.noise.variance_1_apart_dn2;
    data->mean_dn[i] = step.MeanDn();
    data->variance_dn2[i] = variance.value;
    data->noise_of_mean_dn[i] = std::sqrt(std::max(variance.value, kQuantisationVariance_dn2) /
                                          step.frames() / step.pair.pixels);
    // Chi squared of as many differences as there are disjoint pairs of frames.
    const double differences = std::max(1.0, step.frames() / 2.0) * step.pair.pixels;
    data->noise_of_variance_dn2[i] =
        std::max(std::max(variance.value, kQuantisationVariance_dn2) * std::sqrt(2 / differences),
                 variance.standard_error);
  }
}

// Steps without those of `left_out` (fold), with starting values from all of them.
absl::StatusOr<Problem> MakeProblem(const TransferData& transfer,
                                    const std::set<TransferTerm>& terms, int left_out,
                                    bool only_left_out) {
  double dark_mean = 0, dark_steps = 0, dark_variance = 0, longest_s = 0;
  for (const FlatFieldStatistics& step : transfer.steps) {
    longest_s = std::max(longest_s, step.exposure_time_s);
    if (!step.dark) continue;
    dark_mean += step.MeanDn();
    dark_variance += step.noise.variance_1_apart_dn2->value;
    ++dark_steps;
  }
  if (dark_steps > 0) {
    dark_mean /= dark_steps;
    dark_variance /= dark_steps;
  }
  Problem problem;
  Observations& data = problem.data;
  int bright = 0;
  double gain_sum = 0, gain_weight = 0, efficiency_sum = 0, efficiency_weight = 0;
  double largest_photons = 0;
  data.whole_photons = transfer.has_photons;
  for (size_t i = 0; i < transfer.steps.size(); ++i) {
    const FlatFieldStatistics& step = transfer.steps[i];
    if (!step.dark && !IsBelowSaturation(step, dark_mean, transfer.saturation_signal_dn)) continue;
    const double photons =
        step.dark ? 0
        : transfer.has_photons
            ? *step.photons
            : step.exposure_time_s / std::max(longest_s, std::numeric_limits<double>::min());
    if (!step.dark) {
      const double signal = step.MeanDn() - dark_mean;
      gain_sum += signal * (step.noise.variance_1_apart_dn2->value - dark_variance);
      gain_weight += signal * signal;
      efficiency_sum += photons * signal;
      efficiency_weight += photons * photons;
      largest_photons = std::max(largest_photons, photons);
      data.whole_photons &= photons == std::round(photons);
    }
    const bool in_fold = left_out >= 0 && static_cast<int>(i % kFolds) == left_out;
    if (in_fold != only_left_out) continue;
    bright += !step.dark;
    data.steps.push_back(&step);
    data.index.push_back(i);
    data.photons.push_back(photons);
  }
  if (!only_left_out && bright < kFewestBrightSteps) {
    return absl::FailedPreconditionError(
        absl::StrCat("the set has ", bright, " steps with light below saturation, needs at least ",
                     kFewestBrightSteps));
  }
  Fill(transfer.steps, &data);
  data.black_level_dn = dark_mean;
  data.black_level_scatter_dn = transfer.black_level_scatter_dn;
  const double gain = std::max(gain_sum / gain_weight, 1e-6);
  const double efficiency = efficiency_sum / efficiency_weight / gain;
  data.saturation_electrons = std::max(transfer.saturation_signal_dn / gain, 1.0);

  Layout& layout = problem.layout;
  std::vector<double> start;
  const auto add = [&](const char* name, const char* unit, double scale, double value) {
    layout.scale.push_back(scale);
    layout.name_and_unit.emplace_back(name, unit);
    start.push_back(value / scale);
    return static_cast<int>(start.size()) - 1;
  };
  const double electrons = efficiency * largest_photons;
  layout.gain = add("gain_dn_per_electron", "DN/e-", gain, gain);
  layout.efficiency =
      add(transfer.has_photons ? "quantum_efficiency" : "electrons_at_longest_exposure",
          transfer.has_photons ? "" : "e-", std::max(efficiency, 1e-12), efficiency);
  if (transfer.fit_dark_current)
    layout.dark_current =
        add("dark_current_electrons_per_s", "e-/s",
            std::max(1.0 / gain, 1e-3 * electrons) / std::max(longest_s, 1e-9), 0);
  layout.black_level = add("black_level_dn", "DN", std::max(1.0, dark_mean), dark_mean);
  const double dark_electrons2 =
      std::max((dark_variance - kQuantisationVariance_dn2) / Square(gain), 0.01 / Square(gain));
  layout.dark_variance =
      add("dark_noise_variance_electrons2", "e-^2", dark_electrons2, dark_electrons2);
  // Scales of the size that a good camera may have.
  if (terms.contains(TransferTerm::kQuadraticResponse)) {
    layout.quadratic = add("quadratic_response", "", 0.01, 0);
  }
  if (terms.contains(TransferTerm::kCubicResponse)) {
    layout.cubic = add("cubic_response", "", 0.01, 0);
  }
  if (terms.contains(TransferTerm::kBrighterFatter)) {
    layout.brighter_fatter = add("variance_deficit_at_saturation", "", 0.01, 0);
  }
  if (terms.contains(TransferTerm::kExposureTimeOffset)) {
    layout.time_offset = add("exposure_time_offset_s", "s", 1e-3 * longest_s, 0);
  }
  if (terms.contains(TransferTerm::kStrayLight)) {
    layout.stray = add(transfer.has_photons ? "stray_photons" : "stray_light_of_longest_exposure",
                       transfer.has_photons ? "photons" : "", 1e-3 * largest_photons, 0);
  }
  problem.start = Eigen::Map<const Eigen::VectorXd>(start.data(), start.size());
  return problem;
}

struct Fitted {
  Problem problem;
  Solution solution;
  Eigen::MatrixXd covariance;  // of the scaled parameters
};

absl::StatusOr<Fitted> Fit(const TransferData& data, const std::set<TransferTerm>& terms,
                           int left_out) {
  auto problem = MakeProblem(data, terms, left_out, false);
  if (!problem.ok()) return problem.status();
  const auto solution = Maximise(problem->data, problem->layout, problem->start);
  if (!solution) {
    return absl::FailedPreconditionError("the photon transfer's fit does not converge");
  }
  const Eigen::VectorXd deviation = Deviations(problem->data, solution->scatter);
  const Residuals residuals{problem->data, problem->layout, deviation};
  const Eigen::MatrixXd jacobian = Jacobian(residuals, solution->x);
  const Eigen::LDLT<Eigen::MatrixXd> information(jacobian.transpose() * jacobian);
  if (information.info() != Eigen::Success || !information.isPositive() ||
      information.rcond() < 1e-14) {
    return absl::FailedPreconditionError(
        "the steps do not determine all parameters of the photon transfer");
  }
  const Eigen::Index n = solution->x.size();
  return Fitted{*std::move(problem), *solution, information.solve(Eigen::MatrixXd::Identity(n, n))};
}

}  // namespace

double TransferFit::Value(const std::string& name) const {
  const TransferParameter* parameter = Find(name);
  return parameter ? parameter->value : 0;
}

const TransferParameter* TransferFit::Find(const std::string& name) const {
  for (const TransferParameter& parameter : parameters) {
    if (parameter.name == name) return &parameter;
  }
  return nullptr;
}

bool IsBelowSaturation(const FlatFieldStatistics& step, double dark_mean_dn,
                       double saturation_signal_dn) {
  return step.MeanDn() - dark_mean_dn < kLargestShareOfSaturation * saturation_signal_dn &&
         step.share_at_largest <= kLargestClippedShare;
}

absl::StatusOr<TransferFit> FitTransfer(const TransferData& data,
                                        const std::set<TransferTerm>& terms) {
  const auto fitted = Fit(data, terms, -1);
  if (!fitted.ok()) return fitted.status();
  const auto& [problem, solution, covariance] = *fitted;
  TransferFit result;
  for (Eigen::Index k = 0; k < solution.x.size(); ++k) {
    const double scale = problem.layout.scale[k];
    const auto& [name, unit] = problem.layout.name_and_unit[k];
    result.parameters.push_back(
        {name, unit, solution.x[k] * scale, std::sqrt(covariance(k, k)) * scale});
  }
  result.parameters.push_back({"light_scatter_relative", "", solution.scatter.light, 0});
  result.parameters.push_back({"variance_scatter_relative", "", solution.scatter.variance, 0});
  const Eigen::VectorXd deviation = Deviations(problem.data, solution.scatter);
  const Expected expected = Model(problem.data, problem.layout, solution.x);
  const Eigen::Index n = problem.data.size();
  for (Eigen::Index i = 0; i < n; ++i) {
    result.points.push_back({problem.data.index[i], problem.data.mean_dn[i], deviation[i],
                             expected.mean_dn[i], problem.data.variance_dn2[i], deviation[n + i],
                             expected.variance_dn2[i]});
    result.chi_squared +=
        Square((expected.mean_dn[i] - problem.data.mean_dn[i]) / deviation[i]) +
        Square((expected.variance_dn2[i] - problem.data.variance_dn2[i]) / deviation[n + i]);
  }
  result.log_likelihood = solution.log_likelihood;
  // The scatter of light and variance is fitted, too.
  result.degrees_of_freedom = static_cast<int>(2 * n - solution.x.size() - 2);
  return result;
}

absl::StatusOr<TransferPrediction> PredictTransfer(const TransferData& data,
                                                   const std::set<TransferTerm>& terms) {
  TransferPrediction result;
  for (int fold = 0; fold < kFolds; ++fold) {
    const auto fitted = Fit(data, terms, fold);
    if (!fitted.ok()) return fitted.status();
    const auto left_out = MakeProblem(data, terms, fold, true);
    if (!left_out.ok()) return left_out.status();
    const Eigen::VectorXd deviation = Deviations(left_out->data, fitted->solution.scatter);
    // Scales and layout are those of all steps, so parameters mean the same.
    const Residuals residuals{left_out->data, left_out->layout, deviation};
    Eigen::VectorXd values;
    residuals(fitted->solution.x, values);
    const Eigen::MatrixXd jacobian = Jacobian(residuals, fitted->solution.x);
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double variance =
          1 + jacobian.row(i) * fitted->covariance * jacobian.row(i).transpose();
      result.chi_squared += Square(values[i]) / variance;
      result.log_score -= 0.5 * (Square(values[i]) / variance +
                                 std::log(2 * std::numbers::pi * variance * Square(deviation[i])));
      ++result.numbers;
    }
  }
  return result;
}

}  // namespace sightline
