// SPDX-License-Identifier: Apache-2.0
// Base of random effects with one amplitude for every recording with laser light.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/random_effect/law/random_effect.h"

namespace sightline {

// The recordings with laser light, in the order of the set.
struct LitTimes {
  std::vector<int> frames;     // index of each in the set
  Eigen::VectorXd exposure_s;  // exposure times
  std::vector<double> time_s;  // timestamps
};
LitTimes LitTimesOf(const SetModel& model);

// Factor of the covariance of independent amplitudes with these standard deviations.
Eigen::MatrixXd IndependentFactor(const Eigen::VectorXd& deviation);

// Lower triangular factor of the correlation exp(-|t_i - t_j| / tau) of a process that is forgotten
// with the correlation time tau > 0 (Uhlenbeck and Ornstein, Phys. Rev. 36 (1930) 823).
Eigen::MatrixXd ForgettingFactor(const std::vector<double>& times_s, double correlation_time_s);

// Amplitudes that change the light of whole recordings.
class LightRandomEffect : public RandomEffect {
 public:
  Amplitude amplitude() const final { return Amplitude::kLight; }
  Realisation StartNear(const SetParameters& fitted) const final;
  Realisation StartFromRecordings(const SetParameters& nominal) const final;
  Realisation RealisationOf(const std::vector<double>& parameters,
                            const Eigen::VectorXd& amplitudes) const final;

 protected:
  explicit LightRandomEffect(const SetModel& model) : lit_(LitTimesOf(model)), model_(model) {}
  const LitTimes lit_;

 private:
  const SetModel& model_;
};

}  // namespace sightline
