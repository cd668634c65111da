// SPDX-License-Identifier: Apache-2.0
// How recordings scatter about their expectation by effects that are drawn anew for each of them.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// Amplitudes are of a recording, or of the blocks of a plate position, followed by how much more
// light differs within these than on average (relative variance), of every plate position.
enum class Amplitude { kLight, kShift, kReflectance };

// Covariance of the amplitudes, and what is drawn within a recording, on average.
struct ScatterLaw {
  Amplitude amplitude = Amplitude::kLight;
  // Lower triangular factor of the covariance of the amplitudes.
  std::function<Eigen::MatrixXd(const std::vector<double>& parameters)> factor;
  // Of the second parameter: what is larger is no scatter within a recording.
  double largest_shape = std::numeric_limits<double>::infinity();
  // Of every laser recording the variance of its movement about its mean place [px^2], given the
  // amplitudes, or that of its light along a block, relative; empty: none.
  std::function<Eigen::VectorXd(const std::vector<double>& parameters,
                                const Eigen::VectorXd& amplitudes)>
      within;
};

// Of an effect that IsRecordingScatter; `model` and the id must outlive the law. Amplitudes are in
// the order of the laser recordings, or of plate positions.
ScatterLaw ScatterLawOf(std::string_view id, const SetModel& model);

}  // namespace sightline
