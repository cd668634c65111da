// SPDX-License-Identifier: Apache-2.0
// Linear Chebyshev approximation: the fit whose largest absolute residual is least.
//
// The linear program
//   minimise w  subject to  |y_i - a_i . c| <= w for every row i
// is solved by the exchange algorithm, which is the simplex method on its dual
//   maximise sum_i l_i y_i  subject to  sum_i l_i a_i = 0, sum_i |l_i| = 1
// (E. Stiefel, Numer. Math. 2 (1960) 1-17; Watson, Approximation Theory and Numerical Methods,
// 1980, chapter 2). A basis is a reference of rank + 1 rows with residuals of equal magnitude. In
// each step the row of the largest residual takes the place of another one.
//
// The weights l are the certificate of optimality: for any coefficients, sum_i l_i y_i is at most
// the largest residual. They are also the derivatives of the least deviation with respect to y.
//
//   auto fit = FitChebyshev(design, heights_m);
//   if (fit) Use(fit->deviation, fit->active);
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace sightline {

struct ActiveRow {
  int row = 0;
  double weight = 0;  // l_i; has the sign of the residual
};

struct ChebyshevFit {
  Eigen::VectorXd coefficients;   // of the columns; of several, those of the smallest norm
  double deviation = 0;           // largest absolute residual, in the unit of the values
  double lower_bound = 0;         // sum of l_i y_i: no coefficients have a smaller deviation
  std::vector<ActiveRow> active;  // rows of non-zero weight; none where all residuals vanish
};

// `design`: rows x columns, columns may depend on each other; `values`: one for each row. nullopt:
// sizes that do not match, no rows, numbers that are not finite, or no optimum within 1000
// exchanges, which only rounding causes.
std::optional<ChebyshevFit> FitChebyshev(const Eigen::MatrixXd& design,
                                         const Eigen::VectorXd& values);

}  // namespace sightline
