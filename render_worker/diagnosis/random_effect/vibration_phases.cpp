// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/vibration_phases.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/special_functions/sinc.hpp>
#include <cassert>
#include <cmath>
#include <numbers>
#include <utility>

#include "render_worker/diagnosis/random_effect/lit_recordings.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/time/sinusoidal_motion.h"

namespace sightline {

namespace {

using boost::math::sinc_pi;
using std::numbers::pi;
// Standard deviation of a phase that is uniform over the half turn in which its sine differs.
const double kPhaseScale = pi / std::sqrt(12.0);

// Vibration with a given phase for every recording. Phases are those in the middle of the
// exposures: there they depend least on amplitude and frequency, and phi and pi - phi give the same
// image.
class PhasedVibration final : public DescribedEffect {
 public:
  PhasedVibration(const EffectDescription& description, std::vector<double> phases_rad)
      : DescribedEffect(description), phases_rad_(std::move(phases_rad)) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    const double periods = p[1] * frame.exposure_time_s;
    optics.transfer.push_back(
        SinusoidalMotionTransfer(p[0] * frame.sensor.pixel_pitch_m, periods,
                                 phases_rad_[frame.recording_index] - pi * periods));
  }

 private:
  std::vector<double> phases_rad_;
};

// Most probable phases in the middle of the exposures, given displacement and blur of the
// recordings. Another effect may displace some of them, so a Cauchy distribution limits the cost of
// each.
std::vector<double> FirstPhases(double amplitude_px, double frequency_hz,
                                std::span<const RecordedMovement> movements) {
  constexpr int kPhases = 61;
  constexpr double kBlurErrorOfAmplitude = 0.1;  // moments of a clipped and noisy profile
  const auto phase = [](int k) { return pi * (k / (kPhases - 1.0) - 0.5); };
  const auto distance = [](double difference, double error) {
    return std::log1p(difference * difference / (2 * error * error));
  };
  double least = 1e300;
  std::vector<double> best_rad;
  // Search for the common place about which all recordings move.
  for (double place_px = -3 * amplitude_px; place_px <= 3 * amplitude_px; place_px += 0.1) {
    double sum = 0;
    std::vector<double> phases_rad;
    for (const RecordedMovement& seen : movements) {
      const double farthest_px = amplitude_px * sinc_pi(pi * frequency_hz * seen.exposure_time_s);
      const double blur_error =
          std::hypot(seen.blur_error_px2, kBlurErrorOfAmplitude * amplitude_px * amplitude_px);
      double nearest = 1e300, at = 0;
      for (int k = 0; k < kPhases; ++k) {
        const double shift_px = farthest_px * std::sin(phase(k));
        const double blur =
            BlurByVibration(amplitude_px, frequency_hz, seen.exposure_time_s, shift_px);
        const double away = distance(seen.shift_px - place_px - shift_px, seen.shift_error_px) +
                            distance(seen.blur_px2 - blur, blur_error);
        if (away >= nearest) continue;
        nearest = away;
        at = phase(k);
      }
      sum += nearest;
      phases_rad.push_back(at);
    }
    if (sum >= least) continue;
    least = sum;
    best_rad = std::move(phases_rad);
  }
  return best_rad;
}

// Expectation of the set as a function of the phases of the recordings with laser light.
class PhaseModel {
 public:
  explicit PhaseModel(const SetModel& model) : model_(model), lit_(model) {}

  const std::vector<int>& lit() const { return lit_.frames(); }

  // Whitened change of all observation blocks per standardised phase.
  std::vector<Eigen::MatrixXd> Derivatives(const FitResult& fit, const Effect& vibration,
                                           const std::vector<double>& phases_rad) const {
    constexpr double kStep_rad = 0.05;
    std::vector<Eigen::MatrixXd> change;
    for (const Eigen::VectorXd& mean : fit.mean) {
      change.emplace_back(Eigen::MatrixXd::Zero(mean.size(), lit_.count()));
    }
    for (int slot = 0; slot < lit_.slots(); ++slot) {
      std::vector<double> moved_rad = phases_rad;
      for (int i = 0; i < lit_.count(); ++i) {
        if (lit_.SlotOf(i) == slot) moved_rad[lit()[i]] += kStep_rad;
      }
      const BlockVectors mean = Expect(fit, vibration, moved_rad, false);
      const std::vector<int> moved = lit_.RecordingsOfEntries(slot);
      for (int e = 0; e < model_.blocks(); ++e) {
        if (moved[e] < 0) continue;
        change[e].col(moved[e]) =
            (*fit.whitening)(e, (mean[e] - fit.mean[e]) * (kPhaseScale / kStep_rad));
      }
    }
    return change;
  }

  // Best phase of every recording on a grid of all phases, given those of the others. A step by the
  // derivative does not lead from one side of a turning point to the other.
  std::vector<double> Search(const FitResult& fit, const Effect& vibration,
                             const std::vector<bool>& use_block,
                             std::vector<double> phases_rad) const {
    constexpr int kPhases = 12;
    for (int slot = 0; slot < lit_.slots(); ++slot) {
      const BlockVectors origin = Expect(fit, vibration, phases_rad, true);
      std::vector<int> moved = lit_.RecordingsOfEntries(slot);
      for (int e = 0; e < model_.blocks(); ++e) {
        if (!use_block[e]) moved[e] = -1;
      }
      std::vector<double> least(lit_.count(), 0), best_rad = phases_rad;
      for (int e = 0; e < model_.blocks(); ++e) {
        if (moved[e] >= 0) least[moved[e]] += fit.residual[e].squaredNorm();
      }
      for (int k = 0; k < kPhases; ++k) {
        const double phase_rad = pi * ((k + 0.5) / kPhases - 0.5);
        std::vector<double> tried_rad = phases_rad;
        for (int i = 0; i < lit_.count(); ++i) {
          if (lit_.SlotOf(i) == slot) tried_rad[lit()[i]] = phase_rad;
        }
        const BlockVectors mean = Expect(fit, vibration, tried_rad, true);
        std::vector<double> chi_squared(lit_.count(), 0);
        for (int e = 0; e < model_.blocks(); ++e) {
          if (moved[e] < 0) continue;
          chi_squared[moved[e]] +=
              (fit.residual[e] - (*fit.whitening)(e, mean[e] - origin[e])).squaredNorm();
        }
        for (int i = 0; i < lit_.count(); ++i) {
          if (lit_.SlotOf(i) != slot || chi_squared[i] >= least[i]) continue;
          least[i] = chi_squared[i];
          best_rad[lit()[i]] = phase_rad;
        }
      }
      phases_rad = std::move(best_rad);
    }
    return phases_rad;
  }

 private:
  // The expectation of `fit`, whose last effect is the vibration, at other phases.
  BlockVectors Expect(const FitResult& fit, const Effect& vibration,
                      const std::vector<double>& phases_rad, bool middle_only) const {
    const PhasedVibration phased(vibration.description(), phases_rad);
    SetParameters parameters = fit.parameters;
    parameters.effects.back().effect = &phased;
    return model_.Expect(parameters, false, middle_only).mean;
  }

  const SetModel& model_;
  LitRecordings lit_;
};

// `fit` with standardised phases as further parameters, before those of effects.
FitResult WithPhases(FitResult fit, const std::vector<Eigen::MatrixXd>& change,
                     const std::vector<bool>& use_block, const Eigen::VectorXd& phases) {
  const auto effects = static_cast<Eigen::Index>(fit.free.size());
  const Eigen::Index known = fit.standardised.size() - effects;
  const Eigen::Index n = known + phases.size() + effects;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  for (size_t e = 0; e < change.size(); ++e) {
    Eigen::MatrixXd jacobian(change[e].rows(), n);
    jacobian << fit.jacobian[e].leftCols(known), change[e], fit.jacobian[e].rightCols(effects);
    if (use_block[e]) information.noalias() += jacobian.transpose() * jacobian;
    fit.jacobian[e] = std::move(jacobian);
  }
  const auto with = [&](const Eigen::VectorXd& of_phases, const Eigen::VectorXd& others) {
    Eigen::VectorXd all(n);
    all << others.head(known), of_phases, others.tail(effects);
    return all;
  };
  fit.standardised = with(phases, fit.standardised);
  fit.prior_weight = with(Eigen::VectorXd::Ones(phases.size()), fit.prior_weight);
  fit.at_bound.insert(fit.at_bound.begin() + known, phases.size(), false);
  information.diagonal() += fit.prior_weight;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd conditional = fit.covariance.diagonal().tail(effects);
  fit.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
  fit.log_determinant = 2 * solver.matrixLLT().diagonal().array().log().sum();
  fit.prior += phases.squaredNorm();
  const Eigen::VectorXd marginal = fit.covariance.diagonal().tail(effects);
  for (Eigen::Index k = 0; k < effects; ++k) {
    fit.effect_standard_errors[k] *= std::sqrt(marginal[k] / conditional[k]);
  }
  return fit;
}

// Fits of everything but the phases, and steps of the phases.
class PhasedFitter {
 public:
  // The vibration is effect number `index`; its amplitude and frequency are free, too.
  PhasedFitter(const SetModel& model, const Effect& vibration,
               const std::vector<FreeEffectParameter>& free, int index)
      : model_(model), vibration_(vibration), phases_(model), free_(free) {
    free_.push_back({index, 0});
    free_.push_back({index, 1});
    // Comparisons of speckle are informative about movements far below a pixel, not about larger
    // ones: they count in the last fit only.
    for (int e = 0; e < model.blocks(); ++e) {
      use_block_.push_back(!model.StatisticOf(e).compares_speckle());
    }
  }

  void UseAllBlocks() { use_block_.assign(model_.blocks(), true); }

  // `parameters`: the start; the vibration is their last effect. `reference`: the fit whose
  // covariance and derivatives with respect to the nuisance parameters are kept; null: new ones.
  FitResult FitAt(SetParameters parameters, const std::vector<double>& at_rad,
                  const FitResult* reference) const {
    const PhasedVibration phased(vibration_.description(), at_rad);
    parameters.effects.back().effect = &phased;
    FitSettings settings;
    settings.use_block = use_block_;
    settings.renew_jacobian = reference == nullptr;
    settings.rounds.clear();
    if (reference == nullptr) settings.rounds = {{0, 0.1}, {0, 0}};
    FitResult fit = FitSet(model_, parameters, free_, settings, reference);
    Eigen::VectorXd standardised(lit().size());
    for (size_t i = 0; i < lit().size(); ++i) {
      standardised[static_cast<Eigen::Index>(i)] = at_rad[lit()[i]] / kPhaseScale;
    }
    const std::vector<Eigen::MatrixXd> change = phases_.Derivatives(fit, vibration_, at_rad);
    fit = WithPhases(std::move(fit), change, use_block_, standardised);
    fit.parameters.effects.back().effect = &vibration_;
    return fit;
  }

  std::vector<double> SearchPhases(const FitResult& fit, std::vector<double> phases_rad) const {
    return phases_.Search(fit, vibration_, use_block_, std::move(phases_rad));
  }

  // Phases after `part` of a Gauss-Newton step of all parameters together; the next fit corrects
  // the others.
  std::vector<double> StepOfPhases(const FitResult& fit, std::vector<double> phases_rad,
                                   double part) const {
    constexpr double kLargestStep_rad = 0.5;
    Eigen::VectorXd downhill = -fit.prior_weight.cwiseProduct(fit.standardised);
    for (int e = 0; e < model_.blocks(); ++e) {
      if (!use_block_[e]) continue;
      downhill.noalias() += fit.jacobian[e].transpose() * fit.residual[e];
    }
    const auto phased_and_free = static_cast<Eigen::Index>(lit().size() + free_.size());
    const Eigen::VectorXd step = (fit.covariance * downhill)
                                     .segment(fit.standardised.size() - phased_and_free,
                                              static_cast<Eigen::Index>(lit().size()));
    for (size_t i = 0; i < lit().size(); ++i) {
      phases_rad[lit()[i]] += part * std::clamp(kPhaseScale * step[static_cast<Eigen::Index>(i)],
                                                -kLargestStep_rad, kLargestStep_rad);
    }
    return phases_rad;
  }

 private:
  const std::vector<int>& lit() const { return phases_.lit(); }

  const SetModel& model_;
  const Effect& vibration_;
  PhaseModel phases_;
  std::vector<FreeEffectParameter> free_;
  std::vector<bool> use_block_;
};

}  // namespace

std::vector<double> PhasesOfMovements(const SetModel& model, const std::vector<double>& law,
                                      std::span<const RecordedMovement> movements) {
  const std::vector<double> first_rad = FirstPhases(law[0], law[1], movements);
  const PhaseModel phases(model);
  const std::vector<int>& lit = phases.lit();
  assert(lit.size() == movements.size());
  std::vector<double> phases_rad(model.set().frames.size(), 0);
  for (size_t i = 0; i < lit.size(); ++i) phases_rad[lit[i]] = first_rad[i];
  return phases_rad;
}

std::unique_ptr<const Effect> VibrationAtPhases(const Effect& vibration,
                                                std::vector<double> phases_rad) {
  return std::make_unique<const PhasedVibration>(vibration.description(), std::move(phases_rad));
}

FollowedVibration FollowVibration(const SetModel& model, const SetParameters& start,
                                  const std::vector<FreeEffectParameter>& free,
                                  const Effect& vibration, const std::vector<double>& law,
                                  std::vector<double> phases_rad) {
  constexpr int kMostTurns = 8;
  constexpr double kWorthwhile = 1;  // decrease of twice the negative log evidence
  constexpr double kSmallestPart = 0.2;
  PhasedFitter fitter(model, vibration, free, static_cast<int>(start.effects.size()));
  SetParameters first = start;
  first.effects.push_back({&vibration, law});
  FitResult best = fitter.FitAt(std::move(first), phases_rad, nullptr);
  double part = 1;
  for (int turn = 0; turn < kMostTurns && part > kSmallestPart; ++turn) {
    const bool search = turn == 0;
    std::vector<double> tried_rad = search ? fitter.SearchPhases(best, phases_rad)
                                           : fitter.StepOfPhases(best, phases_rad, part);
    FitResult tried = fitter.FitAt(best.parameters, tried_rad, &best);
    const double gained = TwiceCost(best) - TwiceCost(tried);
    if (gained > 0) {
      best = std::move(tried);
      phases_rad = std::move(tried_rad);
      part = 1;
      if (gained < kWorthwhile) break;
    } else if (!search) {
      part /= 2;
    }
  }
  fitter.UseAllBlocks();
  FollowedVibration followed;
  followed.fit = fitter.FitAt(best.parameters, phases_rad, nullptr);
  followed.fit.random_effect = VibrationAtPhases(vibration, phases_rad);
  followed.phases_rad = std::move(phases_rad);
  return followed;
}

}  // namespace sightline
