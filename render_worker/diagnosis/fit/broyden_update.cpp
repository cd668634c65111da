// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/broyden_update.h"

namespace sightline {

void UpdateDerivatives(const Eigen::VectorXd& moves, const Eigen::VectorXd& change,
                       Eigen::MatrixXd& jacobian) {
  const Eigen::VectorXd missing = change - jacobian * moves;
  for (Eigen::Index row = 0; row < jacobian.rows(); ++row) {
    const Eigen::RowVectorXd moved =
        (jacobian.row(row).array() != 0)
            .select(moves.transpose(), Eigen::RowVectorXd::Zero(moves.size()));
    const double square = moved.squaredNorm();
    if (square > 0) jacobian.row(row) += missing[row] / square * moved;
  }
}

}  // namespace sightline
