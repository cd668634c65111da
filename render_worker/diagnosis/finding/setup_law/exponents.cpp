// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/setup_law/exponents.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sightline::setup_law {

Exponents FitExponents(const LawSearch& search, const Standardised& data,
                       const LawSearch::Found& found) {
  constexpr int kSteps = 20;
  const auto powers = static_cast<Eigen::Index>(found.form.powers.size());
  const Eigen::Index first = found.form.offset ? 2 : 1;
  const Eigen::ArrayXd robust =
      ((kFreedom + 1) /
       (kFreedom + found.fit.residual.square() / (found.fit.scale * found.fit.scale)))
          .sqrt();
  Eigen::VectorXd x(first + powers);
  x[0] = found.fit.factor;
  if (found.form.offset) x[1] = found.fit.offset;
  for (Eigen::Index k = 0; k < powers; ++k) {
    x[first + k] = found.form.powers[static_cast<size_t>(k)].exponent;
  }
  Eigen::MatrixXd jacobian(data.amplitude.size(), x.size());
  const auto evaluate = [&](const Eigen::VectorXd& at, bool with_jacobian) {
    std::vector<Power> fitted = found.form.powers;
    for (Eigen::Index k = 0; k < powers; ++k) {
      fitted[static_cast<size_t>(k)].exponent = at[first + k];
    }
    const Eigen::ArrayXd g =
        Product(search.quantities(), fitted, data.amplitude.size()) * data.weight;
    if (with_jacobian) {
      jacobian.col(0) = robust * g;
      if (found.form.offset) jacobian.col(1) = robust * data.weight;
      for (Eigen::Index k = 0; k < powers; ++k) {
        const Eigen::ArrayXd& q =
            search.quantities()[found.form.powers[static_cast<size_t>(k)].quantity].values;
        jacobian.col(first + k) = robust * at[0] * g * (q > 0).select(q.max(1e-300).log(), 0.0);
      }
    }
    const double offset = found.form.offset ? at[1] : 0;
    return Eigen::VectorXd(robust * (data.amplitude - at[0] * g - offset * data.weight));
  };
  for (int iteration = 0; iteration < kSteps; ++iteration) {
    const Eigen::VectorXd residual = evaluate(x, true);
    Eigen::VectorXd step = jacobian.completeOrthogonalDecomposition().solve(residual);
    // Exponents move by one at most.
    const double largest = step.tail(powers).cwiseAbs().maxCoeff();
    if (largest > 1) step /= largest;
    bool better = false;
    for (int half = 0; half < 10 && !better; ++half, step /= 2) {
      const Eigen::VectorXd moved = x + step;
      if (evaluate(moved, false).squaredNorm() <= residual.squaredNorm()) {
        x = moved;
        better = true;
      }
    }
    if (!better || step.norm() < 1e-8 * x.norm()) break;
  }
  const double square = evaluate(x, true).squaredNorm();
  const double freedom = std::max<double>(1, static_cast<double>(data.amplitude.size() - x.size()));
  const double variance = std::max(1.0, square / freedom);
  const Eigen::MatrixXd covariance =
      variance *
      (jacobian.transpose() * jacobian).completeOrthogonalDecomposition().pseudoInverse();
  Exponents result;
  for (Eigen::Index k = 0; k < powers; ++k) {
    result.values.push_back(x[first + k]);
    result.standard_errors.push_back(std::sqrt(std::max(0.0, covariance(first + k, first + k))));
  }
  return result;
}
}  // namespace sightline::setup_law
