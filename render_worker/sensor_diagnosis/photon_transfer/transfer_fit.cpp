// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_fit.h"

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
#include "core/statistics/square.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Range of the relative standard deviations from step to step: from far below photon noise of all
// pixels to light that is hardly controlled. The search starts in between.
constexpr double kLeastDeviation = 1e-7, kLargestDeviation = 0.1, kFirstDeviation = 1e-3;
// Golden-section steps of one search, which bring its logarithm to 0.02; rounds of searches for
// light and variance in turn. Rounds after the first search this far around the last result [nats].
constexpr int kGoldenSections = 14, kSearchRounds = 3;
constexpr double kLaterSearchWidth = 2;
constexpr int kMaxEvaluations = 4000;
// Step of central differences, relative to parameters of the order of one: near the cube root of
// the machine precision.
constexpr double kDifferenceStep = 1e-5;
// Smallest reciprocal condition number of the information matrix that still determines all
// parameters in double precision.
constexpr double kLeastCondition = 1e-14;

// Weighted residuals in the form that Eigen's minimiser asks for.
struct TransferResiduals {
  using Scalar = double;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };
  using InputType = Eigen::VectorXd;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;

  int inputs() const { return static_cast<int>(layout.scale.size()); }
  int values() const { return static_cast<int>(2 * data.size()); }
  int operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residuals) const {
    const TransferMoments expected = ExpectedMoments(data, layout, x);
    residuals.resize(2 * data.size());
    residuals << expected.mean_dn - data.mean_dn, expected.variance_dn2 - data.variance_dn2;
    residuals.array() /= deviation.array();
    return 0;
  }

  const TransferObservations& data;
  const TransferLayout& layout;
  const Eigen::VectorXd& deviation;
};

Eigen::MatrixXd JacobianOf(const TransferResiduals& residuals, const Eigen::VectorXd& x) {
  Eigen::MatrixXd jacobian(residuals.values(), residuals.inputs());
  Eigen::VectorXd above, below;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double step = kDifferenceStep * std::max(1.0, std::abs(x[k]));
    Eigen::VectorXd moved = x;
    moved[k] = x[k] + step;
    residuals(moved, above);
    moved[k] = x[k] - step;
    residuals(moved, below);
    jacobian.col(k) = (above - below) / (2 * step);
  }
  return jacobian;
}

struct TransferSolution {
  Eigen::VectorXd x;  // scaled parameters
  BetweenStepDeviation between_steps;
  double log_likelihood = 0;
};

// Least squares given the deviations between steps; unset if it does not converge.
std::optional<TransferSolution> SolveGivenDeviation(const TransferProblem& problem,
                                                    const Eigen::VectorXd& start,
                                                    const BetweenStepDeviation& between_steps) {
  const Eigen::VectorXd deviation = StandardDeviations(problem.data, between_steps);
  const TransferResiduals residuals{problem.data, problem.layout, deviation};
  Eigen::NumericalDiff<TransferResiduals, Eigen::Central> differentiated(residuals);
  Eigen::LevenbergMarquardt<decltype(differentiated)> solver(differentiated);
  solver.parameters.maxfev = kMaxEvaluations;
  TransferSolution solution{start, between_steps, 0};
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

// The best solution so far. Later fits start from its parameters.
struct LikelihoodSearch {
  std::optional<TransferSolution> best;
  Eigen::VectorXd start;
};

// The log-likelihood given these deviations. The solution takes part in the search.
double Evaluate(const TransferProblem& problem, const BetweenStepDeviation& between_steps,
                LikelihoodSearch* search) {
  const auto solution = SolveGivenDeviation(problem, search->start, between_steps);
  if (!solution) return -std::numeric_limits<double>::infinity();
  if (!search->best || solution->log_likelihood > search->best->log_likelihood) {
    search->best = solution;
    search->start = solution->x;
  }
  return solution->log_likelihood;
}

// Golden-section search for the logarithm of one deviation in [low, high], given the other one.
LikelihoodSearch SearchDeviation(const TransferProblem& problem,
                                 const BetweenStepDeviation& between_steps,
                                 double BetweenStepDeviation::*searched, double low, double high,
                                 LikelihoodSearch search) {
  constexpr double kGolden = std::numbers::phi - 1;
  const auto value = [&](double log_deviation) {
    BetweenStepDeviation at = between_steps;
    at.*searched = std::exp(log_deviation);
    return Evaluate(problem, at, &search);
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
  return search;
}

// Maximum over the parameters and both deviations between steps, one deviation after the other.
std::optional<TransferSolution> MaximiseLikelihood(const TransferProblem& problem) {
  LikelihoodSearch search{std::nullopt, problem.start};
  BetweenStepDeviation between_steps{kFirstDeviation, kFirstDeviation};
  for (int round = 0; round < kSearchRounds; ++round) {
    for (double BetweenStepDeviation::*searched :
         {&BetweenStepDeviation::light, &BetweenStepDeviation::variance}) {
      const double centre = std::log(between_steps.*searched);
      const double width = round == 0 ? 100 : kLaterSearchWidth;  // 100: the whole range
      const double low = std::max(std::log(kLeastDeviation), centre - width);
      const double high = std::min(std::log(kLargestDeviation), centre + width);
      search = SearchDeviation(problem, between_steps, searched, low, high, std::move(search));
      if (search.best) between_steps = search.best->between_steps;
    }
  }
  return search.best;
}

struct FittedTransfer {
  TransferProblem problem;
  TransferSolution solution;
  Eigen::MatrixXd covariance;  // of the scaled parameters
};

absl::StatusOr<FittedTransfer> FitSteps(const TransferData& data,
                                        const std::set<TransferTerm>& terms, FoldPart part,
                                        int fold) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto problem, MakeTransferProblem(data, terms, part, fold));
  const auto solution = MaximiseLikelihood(problem);
  if (!solution) {
    return absl::FailedPreconditionError("the photon transfer's fit does not converge");
  }
  const Eigen::VectorXd deviation = StandardDeviations(problem.data, solution->between_steps);
  const TransferResiduals residuals{problem.data, problem.layout, deviation};
  const Eigen::MatrixXd jacobian = JacobianOf(residuals, solution->x);
  const Eigen::LDLT<Eigen::MatrixXd> information(jacobian.transpose() * jacobian);
  if (information.info() != Eigen::Success || !information.isPositive() ||
      information.rcond() < kLeastCondition) {
    return absl::FailedPreconditionError(
        "the steps do not determine all parameters of the photon transfer");
  }
  const Eigen::Index n = solution->x.size();
  return FittedTransfer{std::move(problem), *solution,
                        information.solve(Eigen::MatrixXd::Identity(n, n))};
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

absl::StatusOr<TransferFit> FitTransfer(const TransferData& data,
                                        const std::set<TransferTerm>& terms) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto fitted, FitSteps(data, terms, FoldPart::kAll, 0));
  const auto& [problem, solution, covariance] = fitted;
  TransferFit result;
  for (Eigen::Index k = 0; k < solution.x.size(); ++k) {
    const double scale = problem.layout.scale[k];
    const auto& [name, unit] = problem.layout.name_and_unit[k];
    result.parameters.push_back(
        {name, unit, solution.x[k] * scale, std::sqrt(covariance(k, k)) * scale});
  }
  result.parameters.push_back({"light_scatter_relative", "", solution.between_steps.light, 0});
  result.parameters.push_back(
      {"variance_scatter_relative", "", solution.between_steps.variance, 0});
  const Eigen::VectorXd deviation = StandardDeviations(problem.data, solution.between_steps);
  const TransferMoments expected = ExpectedMoments(problem.data, problem.layout, solution.x);
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
  // The two deviations between steps are fitted parameters.
  result.degrees_of_freedom = static_cast<int>(2 * n - solution.x.size() - 2);
  return result;
}

absl::StatusOr<TransferPrediction> PredictTransfer(const TransferData& data,
                                                   const std::set<TransferTerm>& terms) {
  TransferPrediction result;
  for (int fold = 0; fold < kTransferFolds; ++fold) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto fitted,
                               FitSteps(data, terms, FoldPart::kWithoutFold, fold));
    SIGHTLINE_ASSIGN_OR_RETURN(const auto left_out,
                               MakeTransferProblem(data, terms, FoldPart::kFoldOnly, fold));
    const Eigen::VectorXd deviation =
        StandardDeviations(left_out.data, fitted.solution.between_steps);
    const TransferResiduals residuals{left_out.data, left_out.layout, deviation};
    Eigen::VectorXd values;
    residuals(fitted.solution.x, values);
    const Eigen::MatrixXd jacobian = JacobianOf(residuals, fitted.solution.x);
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double variance = 1 + jacobian.row(i) * fitted.covariance * jacobian.row(i).transpose();
      result.chi_squared += Square(values[i]) / variance;
      result.log_score -= 0.5 * (Square(values[i]) / variance +
                                 std::log(2 * std::numbers::pi * variance * Square(deviation[i])));
      ++result.numbers;
    }
  }
  return result;
}

}  // namespace sightline
