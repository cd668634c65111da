// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/law/per_recording.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace sightline {

LitTimes LitTimesOf(const SetModel& model) {
  LitTimes lit;
  std::vector<double> exposure_s;
  const std::vector<RecordedFrame>& frames = model.set().frames;
  for (size_t f = 0; f < frames.size(); ++f) {
    if (frames[f].plate_position_id < 0) continue;
    lit.frames.push_back(static_cast<int>(f));
    exposure_s.push_back(frames[f].nominal.exposure_time_s);
    lit.time_s.push_back(frames[f].nominal.timestamp_s);
  }
  lit.exposure_s = Eigen::Map<const Eigen::VectorXd>(exposure_s.data(),
                                                     static_cast<Eigen::Index>(exposure_s.size()));
  return lit;
}

Eigen::MatrixXd IndependentFactor(const Eigen::VectorXd& deviation) {
  return deviation.asDiagonal();
}

Eigen::MatrixXd ForgettingFactor(const std::vector<double>& times_s, double correlation_time_s) {
  // Recordings with the same timestamp have correlation 1: the matrix must stay positive definite.
  constexpr double kNugget = 1e-9;
  const auto n = static_cast<Eigen::Index>(times_s.size());
  Eigen::MatrixXd correlation(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      correlation(i, j) = std::exp(-std::abs(times_s[i] - times_s[j]) / correlation_time_s);
    }
    correlation(i, i) += kNugget;
  }
  return correlation.llt().matrixL();
}

Realisation LightRandomEffect::StartNear(const SetParameters& /*fitted*/) const {
  return Realisation(model_.set().frames.size());
}

Realisation LightRandomEffect::StartFromRecordings(const SetParameters& nominal) const {
  Realisation realisation(model_.set().frames.size());
  realisation.light_relative = LightExcesses(model_, nominal);
  return realisation;
}

Realisation LightRandomEffect::RealisationOf(const std::vector<double>& /*parameters*/,
                                             const Eigen::VectorXd& amplitudes) const {
  Realisation realisation(model_.set().frames.size());
  for (size_t i = 0; i < lit_.frames.size(); ++i) {
    realisation.light_relative[lit_.frames[i]] = amplitudes[static_cast<Eigen::Index>(i)];
  }
  return realisation;
}

}  // namespace sightline
