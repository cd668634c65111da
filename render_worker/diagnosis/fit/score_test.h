// SPDX-License-Identifier: Apache-2.0
// Score test of a fitted model in given directions: would changes of the expectation in these
// directions improve the fit by more than noise does? A chi squared over all numbers spreads a
// small departure over hundreds of them; a test along few directions does not (Rao, Proc. Camb.
// Phil. Soc. 44 (1948) 50).
#pragma once

#include <Eigen/Core>

#include "render_worker/diagnosis/fit/linear_fit.h"

namespace sightline {

// Squared whitened length of a direction, after refitting, above which it is tested. Chosen: a
// change of one standard deviation at one prior scale; below, the recordings do not show it.
inline constexpr double kTestedLength = 1;

struct ScoreTest {
  double chi_squared = 0;
  int degrees_of_freedom = 0;  // independent directions that the recordings show
  double p_value = 1;          // probability of a chi squared at least as large
};

// With the whitened residual r at the optimum of the linearised model, P = I - J H^-1 J' of
// LinearFit and the directions D, the score D' r has the covariance D' P D if the model is true.
// Principal axes of D' P D whose eigenvalue exceeds kTestedLength give independent standard normal
// scores u = U' r. Errors of the modelled expectation add U' P E E' P U to their covariance M, and
// chi squared is u' M^-1 u. `directions`: whitened changes by one prior scale each, in columns; all
// must be finite. `model_error`: columns E of standard deviations of independent errors of the
// whitened expectation; may have no column.
ScoreTest TestDirections(const LinearFit& linear, const Eigen::MatrixXd& directions,
                         const Eigen::MatrixXd& model_error);

}  // namespace sightline
