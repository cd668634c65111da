// SPDX-License-Identifier: Apache-2.0
// Random effects of the exposure time T: amplitudes are relative deviations of a recording's light,
// independent of each other.
#include "render_worker/diagnosis/random_effect/law/per_recording.h"

namespace sightline {

namespace {

// Standard deviation s / T. Parameters: s [s].
class ExposureTime final : public LightRandomEffect {
 public:
  explicit ExposureTime(const SetModel& model) : LightRandomEffect(model) {}
  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& p) const override {
    return IndependentFactor(p[0] * lit_.exposure_s.cwiseInverse());
  }
};

// Standard deviation s (T / 1 ms)^-g. Parameters: s, relative; g.
class ScaledExposureTime final : public LightRandomEffect {
 public:
  explicit ScaledExposureTime(const SetModel& model) : LightRandomEffect(model) {}
  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& p) const override {
    return IndependentFactor(p[0] * (lit_.exposure_s.array() / 1e-3).pow(-p[1]).matrix());
  }
};

}  // namespace

std::unique_ptr<const RandomEffect> MakeExposureTime(const SetModel& model) {
  return std::make_unique<ExposureTime>(model);
}

std::unique_ptr<const RandomEffect> MakeScaledExposureTime(const SetModel& model) {
  return std::make_unique<ScaledExposureTime>(model);
}

}  // namespace sightline
