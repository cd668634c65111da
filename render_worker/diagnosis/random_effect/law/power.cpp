// SPDX-License-Identifier: Apache-2.0
// Random effects of the laser power: amplitudes are relative deviations of a recording's light.
#include "render_worker/diagnosis/random_effect/law/per_recording.h"

namespace sightline {

namespace {

// K = s^2 I. Parameters: s, relative.
class Power final : public LightRandomEffect {
 public:
  explicit Power(const SetModel& model) : LightRandomEffect(model) {}
  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& p) const override {
    return IndependentFactor(Eigen::VectorXd::Constant(lit_.exposure_s.size(), p[0]));
  }
};

// K_ij = s^2 exp(-|t_i - t_j| / tau) for timestamps t. Parameters: s, relative; tau [s].
class CorrelatedPower final : public LightRandomEffect {
 public:
  explicit CorrelatedPower(const SetModel& model) : LightRandomEffect(model) {}
  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& p) const override {
    return p[0] * ForgettingFactor(lit_.time_s, p[1]);
  }
};

}  // namespace

std::unique_ptr<const RandomEffect> MakePower(const SetModel& model) {
  return std::make_unique<Power>(model);
}

std::unique_ptr<const RandomEffect> MakeCorrelatedPower(const SetModel& model) {
  return std::make_unique<CorrelatedPower>(model);
}

}  // namespace sightline
