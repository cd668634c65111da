// SPDX-License-Identifier: Apache-2.0
// Random movements of the image across the line: amplitudes are the mean displacements during the
// exposures [px]; the variance of the displacement about its mean blurs the line.
#include <boost/math/special_functions/sinc.hpp>
#include <cmath>
#include <numbers>

#include "render_worker/diagnosis/random_effect/law/per_recording.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"

namespace sightline {

namespace {

using boost::math::sinc_pi;

// Mean square of the mean of a sinusoid of unit amplitude over an exposure, over all phases.
double ShiftVariance(double frequency_hz, double exposure_s) {
  return 0.5 * std::pow(sinc_pi(std::numbers::pi * frequency_hz * exposure_s), 2);
}

// Mean square of the mean over an exposure of a process of unit variance whose correlation is
// exp(-|t| / tau).
double MeanSquareOfWandering(double correlation_time_s, double exposure_s) {
  const double x = exposure_s / correlation_time_s;
  return x < 1e-4 ? 1 - x / 3 : 2 * (x + std::expm1(-x)) / (x * x);
}

class Movement : public RandomEffect {
 public:
  Amplitude amplitude() const final { return Amplitude::kShift; }

  Realisation StartNear(const SetParameters& fitted) const final {
    Realisation realisation(model_.set().frames.size());
    realisation.shift_px = DisplacementsAtPositions(model_, fitted);
    return realisation;
  }

  Realisation StartFromRecordings(const SetParameters& nominal) const final {
    return LineMovements(model_, nominal);
  }

  Realisation RealisationOf(const std::vector<double>& parameters,
                            const Eigen::VectorXd& amplitudes) const final {
    Realisation realisation(model_.set().frames.size());
    const Eigen::VectorXd blur_px2 = VarianceWithin(parameters, amplitudes);
    for (size_t i = 0; i < lit_.frames.size(); ++i) {
      const auto recording = static_cast<Eigen::Index>(i);
      realisation.shift_px[lit_.frames[i]] = amplitudes[recording];
      realisation.blur_px2[lit_.frames[i]] = blur_px2[recording];
    }
    return realisation;
  }

 protected:
  explicit Movement(const SetModel& model) : model_(model), lit_(LitTimesOf(model)) {}
  const SetModel& model_;
  const LitTimes lit_;
};

// x(t) = A sin(2 pi f t + phase), phases independent and uniform. Parameters: A [px], f [Hz].
class Vibration final : public Movement {
 public:
  explicit Vibration(const SetModel& model) : Movement(model) {}

  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& p) const override {
    const Eigen::VectorXd variance =
        lit_.exposure_s.unaryExpr([&](double t) { return ShiftVariance(p[1], t); });
    return IndependentFactor(p[0] * variance.cwiseSqrt());
  }

  Eigen::VectorXd VarianceWithin(const std::vector<double>& p,
                                 const Eigen::VectorXd& shift_px) const override {
    Eigen::VectorXd blur_px2(lit_.exposure_s.size());
    for (Eigen::Index i = 0; i < blur_px2.size(); ++i) {
      blur_px2[i] = BlurByVibration(p[0], p[1], lit_.exposure_s[i], shift_px[i]);
    }
    return blur_px2;
  }

  std::optional<MovementParameters> FitMovements(
      std::span<const RecordedMovement> movements) const override {
    const VibrationFit fit = FitVibration(movements);
    MovementParameters found;
    found.parameters = {fit.amplitude_px, fit.frequency_hz};
    found.standard_errors = {fit.amplitude_error_px, fit.frequency_error_hz};
    found.phases_rad = PhasesOfMovements(model_, found.parameters, movements);
    return found;
  }
};

// An Ornstein-Uhlenbeck process. Parameters: its standard deviation s [px], its correlation time
// [s].
class CorrelatedMovement final : public Movement {
 public:
  explicit CorrelatedMovement(const SetModel& model) : Movement(model) {}

  Eigen::MatrixXd CovarianceFactor(const std::vector<double>& p) const override {
    return p[0] * ShiftShare(p[1]).cwiseSqrt().asDiagonal() * ForgettingFactor(lit_.time_s, p[1]);
  }

  Eigen::VectorXd VarianceWithin(const std::vector<double>& p,
                                 const Eigen::VectorXd& /*shift_px*/) const override {
    return p[0] * p[0] * (1 - ShiftShare(p[1]).array()).matrix();
  }

 private:
  // Fraction of the variance that moves a recording as a whole; the rest blurs it.
  Eigen::VectorXd ShiftShare(double correlation_time_s) const {
    return lit_.exposure_s.unaryExpr(
        [=](double t) { return MeanSquareOfWandering(correlation_time_s, t); });
  }
};

}  // namespace

std::unique_ptr<const RandomEffect> MakeVibration(const SetModel& model) {
  return std::make_unique<Vibration>(model);
}

std::unique_ptr<const RandomEffect> MakeCorrelatedMovement(const SetModel& model) {
  return std::make_unique<CorrelatedMovement>(model);
}

}  // namespace sightline
