// SPDX-License-Identifier: Apache-2.0
#include "core/association/chebyshev_fit.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostExchanges = 1000;
// Columns whose independent part is below this share of the largest depend on the others: positions
// of targets are in single precision.
constexpr double kRankThreshold = 1e-6;
// Residuals that differ by less than this share of the largest value are equal.
constexpr double kRounding = 1e-11;

// Rows with signs, for which the dual weights |l_i| are >= 0.
struct Reference {
  std::vector<Index> rows;
  std::vector<double> signs;

  // Columns (sign * a_i; 1): the dual constraints.
  MatrixXd Matrix(const MatrixXd& basis) const {
    MatrixXd m(basis.cols() + 1, static_cast<Index>(rows.size()));
    for (size_t j = 0; j < rows.size(); ++j) {
      m.col(static_cast<Index>(j)) << signs[j] * basis.row(rows[j]).transpose(), 1;
    }
    return m;
  }
};

// Any rank + 1 rows, of which the first `rank` are independent, have one linear dependence. The
// signs of its factors make the weights non-negative.
Reference FirstReference(const MatrixXd& basis, const VectorXd& values) {
  const Index rank = basis.cols();
  const Eigen::ColPivHouseholderQR<MatrixXd> pivoted(basis.transpose());
  Reference reference;
  for (Index j = 0; j < rank; ++j) {
    reference.rows.push_back(pivoted.colsPermutation().indices()[j]);
  }
  Index last = -1;
  for (Index i = 0; i < values.size(); ++i) {
    const bool taken =
        std::find(reference.rows.begin(), reference.rows.end(), i) != reference.rows.end();
    if (!taken && (last < 0 || std::abs(values[i]) > std::abs(values[last]))) last = i;
  }
  MatrixXd independent(rank, rank);
  for (Index j = 0; j < rank; ++j) {
    independent.col(j) = basis.row(reference.rows[static_cast<size_t>(j)]).transpose();
  }
  VectorXd factors(rank + 1);
  factors.head(rank) = -independent.partialPivLu().solve(basis.row(last).transpose());
  factors[rank] = 1;
  reference.rows.push_back(last);
  double sum = 0;
  for (Index j = 0; j <= rank; ++j)
    sum += factors[j] * values[reference.rows[static_cast<size_t>(j)]];
  for (Index j = 0; j <= rank; ++j) {
    reference.signs.push_back((factors[j] < 0) == (sum < 0) ? 1 : -1);
  }
  return reference;
}

// The row that enters: that of the largest residual, or after steps that gained nothing the first
// one beyond the deviation (Bland's rule, which cannot cycle); -1: none is beyond.
Index Entering(const VectorXd& residuals, double beyond, bool first_one) {
  Index entering = -1;
  double largest = beyond;
  for (Index i = 0; i < residuals.size(); ++i) {
    if (!(std::abs(residuals[i]) > largest)) continue;
    entering = i;
    if (first_one) break;
    largest = std::abs(residuals[i]);
  }
  return entering;
}

// The place in the reference whose weight reaches zero first as the entering row's grows.
size_t Leaving(const Reference& reference, const VectorXd& weights, const VectorXd& direction,
               bool first_one) {
  constexpr double kNoChange = 1e-10, kTie = 1e-12;
  double least = std::numeric_limits<double>::infinity();
  for (Index j = 0; j < weights.size(); ++j) {
    if (direction[j] > kNoChange) {
      least = std::min(least, std::max(0.0, weights[j]) / direction[j]);
    }
  }
  size_t leaving = 0;
  bool found = false;
  for (Index j = 0; j < weights.size(); ++j) {
    if (!(direction[j] > kNoChange)) continue;
    if (std::max(0.0, weights[j]) / direction[j] > least + kTie) continue;
    const auto place = static_cast<size_t>(j);
    const bool better = first_one ? reference.rows[place] < reference.rows[leaving]
                                  : direction[j] > direction[static_cast<Index>(leaving)];
    if (!found || better) leaving = place;
    found = true;
  }
  return leaving;
}

}  // namespace

std::optional<ChebyshevFit> FitChebyshev(const MatrixXd& design, const VectorXd& values) {
  if (design.rows() != values.size() || values.size() == 0 || !design.allFinite() ||
      !values.allFinite()) {
    return std::nullopt;
  }
  if (design.cols() == 0 || design.isZero(0)) {
    ChebyshevFit fit;
    Index largest = 0;
    fit.deviation = fit.lower_bound = values.cwiseAbs().maxCoeff(&largest);
    fit.coefficients = VectorXd::Zero(design.cols());
    if (fit.deviation > 0)
      fit.active = {{static_cast<int>(largest), values[largest] < 0 ? -1. : 1.}};
    return fit;
  }
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition;
  decomposition.setThreshold(kRankThreshold);
  decomposition.compute(design);
  const Index rank = decomposition.rank();
  const MatrixXd basis = decomposition.householderQ() * MatrixXd::Identity(design.rows(), rank);
  // From least squares on, numbers are of the order of the deviation.
  const VectorXd start = basis.transpose() * values;
  const VectorXd left = values - basis * start;
  ChebyshevFit fit;
  fit.coefficients = decomposition.solve(values);
  fit.deviation = (values - design * fit.coefficients).cwiseAbs().maxCoeff();
  const double scale = left.cwiseAbs().maxCoeff();
  if (values.size() <= rank || !(scale > 1e-14 * values.cwiseAbs().maxCoeff())) return fit;

  Reference reference = FirstReference(basis, left);
  VectorXd weights_sum = VectorXd::Zero(rank + 1);
  weights_sum[rank] = 1;
  double before = -1;
  int without_gain = 0;
  for (int exchange = 0; exchange < kMostExchanges; ++exchange) {
    const Eigen::PartialPivLU<MatrixXd> lu(reference.Matrix(basis));
    const VectorXd weights = lu.solve(weights_sum);
    VectorXd at_reference(rank + 1);
    for (Index j = 0; j <= rank; ++j) {
      const auto place = static_cast<size_t>(j);
      at_reference[j] = reference.signs[place] * left[reference.rows[place]];
    }
    const VectorXd solution = lu.transpose().solve(at_reference);  // coefficients, then w
    const VectorXd change = solution.head(rank);
    const double deviation = solution[rank];
    if (!solution.allFinite()) return std::nullopt;
    without_gain = deviation > before + kRounding * scale ? 0 : without_gain + 1;
    before = std::max(before, deviation);
    const bool first_one = without_gain > 3;
    const VectorXd residuals = left - basis * change;
    const Index entering = Entering(residuals, deviation + kRounding * scale, first_one);
    if (entering < 0) {
      fit.coefficients = decomposition.solve(basis * (start + change));
      fit.deviation = (values - design * fit.coefficients).cwiseAbs().maxCoeff();
      for (Index j = 0; j <= rank; ++j) {
        if (!(weights[j] > kRounding)) continue;
        const auto place = static_cast<size_t>(j);
        fit.active.push_back(
            {static_cast<int>(reference.rows[place]), reference.signs[place] * weights[j]});
        fit.lower_bound += fit.active.back().weight * left[reference.rows[place]];
      }
      return fit;
    }
    const double sign = residuals[entering] < 0 ? -1 : 1;
    VectorXd column(rank + 1);
    column << sign * basis.row(entering).transpose(), 1;
    const size_t leaving = Leaving(reference, weights, lu.solve(column), first_one);
    reference.rows[leaving] = entering;
    reference.signs[leaving] = sign;
  }
  return std::nullopt;
}

}  // namespace sightline
