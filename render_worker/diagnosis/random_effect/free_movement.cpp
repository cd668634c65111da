// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/free_movement.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace sightline {

std::vector<RecordedMovement> FreeMovements(const LinearisationBasis& basis,
                                            const LinearisedSet& linear) {
  constexpr double kShift_px = 10, kBlur_px2 = 10;  // standard deviations of the prior
  const ProjectedModel& projected = linear.projected;
  const Eigen::Index n = basis.recordings();
  Eigen::MatrixXd information(2 * n, 2 * n);
  information << projected.inner, projected.offset_cross, projected.offset_cross.transpose(),
      projected.offset_inner;
  information.diagonal().head(n).array() += 1 / (kShift_px * kShift_px);
  information.diagonal().tail(n).array() += 1 / (kBlur_px2 * kBlur_px2);
  Eigen::VectorXd slope(2 * n);
  slope << projected.slope + projected.offset_cross * linear.variance_within,
      projected.offset_slope + projected.offset_inner * linear.variance_within;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd found = solver.solve(slope);
  const Eigen::VectorXd variance = solver.solve(Eigen::MatrixXd::Identity(2 * n, 2 * n)).diagonal();
  // The place of a plate position can hardly be separated from a movement there.
  const double place_error_px = basis.model.set().description.uncertainty.line_position_each_px;
  std::vector<RecordedMovement> movements;
  for (int i = 0; i < basis.recordings(); ++i) {
    const RecordedFrame& frame = basis.model.set().frames[basis.lit.frames()[i]];
    movements.push_back({.exposure_time_s = frame.nominal.exposure_time_s,
                         .shift_px = found[i],
                         .shift_error_px = std::hypot(std::sqrt(variance[i]), place_error_px),
                         .blur_px2 = std::max(0.0, found[n + i]),
                         .blur_error_px2 = std::sqrt(variance[n + i])});
  }
  return movements;
}

LinearisedSet LineariseAboutFreeMovements(const LinearisationBasis& basis, LinearisedSet linear) {
  constexpr int kTurns = 3;
  constexpr double kLargestStep_px = 0.5, kLargestStep_px2 = 0.5;  // a profile is far from linear
  for (int turn = 0; turn < kTurns; ++turn) {
    const std::vector<RecordedMovement> movements = FreeMovements(basis, linear);
    Realisation realisation(basis.model.set().frames.size());
    for (int i = 0; i < basis.recordings(); ++i) {
      const double shift_px = linear.amplitudes[i], blur_px2 = linear.variance_within[i];
      realisation.shift_px[basis.lit.frames()[i]] =
          shift_px +
          std::clamp(movements[i].shift_px - shift_px, -kLargestStep_px, kLargestStep_px);
      realisation.blur_px2[basis.lit.frames()[i]] =
          blur_px2 +
          std::clamp(movements[i].blur_px2 - blur_px2, -kLargestStep_px2, kLargestStep_px2);
    }
    linear = Linearise(basis, Amplitude::kShift, realisation);
  }
  return linear;
}

}  // namespace sightline
