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

// The phases are those in the middle of the exposures: then amplitude and frequency change them
// least, and a phase and half a turn minus it look the same.
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

// Phases in the middle of the exposures that displacement and blur of the recordings speak for.
// Another effect may displace some of them: none counts for more than a few standard errors.
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
  // Of the place about which all move.
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

// What the phases of the recordings with laser light do to the entries.
class PhaseModel {
 public:
  explicit PhaseModel(const SetModel& model) : model_(model), lit_(model) {}

  const std::vector<int>& lit() const { return lit_.frames(); }

  // Whitened change of all entries per standardised phase.
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
      const Entries mean = Expect(fit, vibration, moved_rad, false);
      const std::vector<int> moved = lit_.RecordingsOfEntries(slot);
      for (int e = 0; e < model_.entries(); ++e) {
        if (moved[e] < 0) continue;
        change[e].col(moved[e]) =
            (*fit.whitening)(e, (mean[e] - fit.mean[e]) * (kPhaseScale / kStep_rad));
      }
    }
    return change;
  }

  // Every recording's phase where it fits best while the others stay, over all of them: near where
  // the image turns, a phase on the wrong side does not find back.
  std::vector<double> Search(const FitResult& fit, const Effect& vibration,
                             const std::vector<bool>& use_entry,
                             std::vector<double> phases_rad) const {
    constexpr int kPhases = 12;
    for (int slot = 0; slot < lit_.slots(); ++slot) {
      const Entries origin = Expect(fit, vibration, phases_rad, true);
      std::vector<int> moved = lit_.RecordingsOfEntries(slot);
      for (int e = 0; e < model_.entries(); ++e) {
        if (!use_entry[e]) moved[e] = -1;
      }
      std::vector<double> least(lit_.count(), 0), best_rad = phases_rad;
      for (int e = 0; e < model_.entries(); ++e) {
        if (moved[e] >= 0) least[moved[e]] += fit.residual[e].squaredNorm();
      }
      for (int k = 0; k < kPhases; ++k) {
        const double phase_rad = pi * ((k + 0.5) / kPhases - 0.5);
        std::vector<double> tried_rad = phases_rad;
        for (int i = 0; i < lit_.count(); ++i) {
          if (lit_.SlotOf(i) == slot) tried_rad[lit()[i]] = phase_rad;
        }
        const Entries mean = Expect(fit, vibration, tried_rad, true);
        std::vector<double> chi_squared(lit_.count(), 0);
        for (int e = 0; e < model_.entries(); ++e) {
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
  Entries Expect(const FitResult& fit, const Effect& vibration,
                 const std::vector<double>& phases_rad, bool middle_only) const {
    const PhasedVibration phased(vibration.description(), phases_rad);
    SetParameters parameters = fit.parameters;
    parameters.effects.back().effect = &phased;
    return model_.Expect(parameters, false, middle_only).mean;
  }

  const SetModel& model_;
  LitRecordings lit_;
};

// With the phases' columns, in front of those of effects.
FitResult WithPhases(FitResult fit, const std::vector<Eigen::MatrixXd>& change,
                     const std::vector<bool>& use_entry, const Eigen::VectorXd& phases) {
  const auto effects = static_cast<Eigen::Index>(fit.free.size());
  const Eigen::Index known = fit.standardised.size() - effects;
  const Eigen::Index n = known + phases.size() + effects;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  for (size_t e = 0; e < change.size(); ++e) {
    Eigen::MatrixXd jacobian(change[e].rows(), n);
    jacobian << fit.jacobian[e].leftCols(known), change[e], fit.jacobian[e].rightCols(effects);
    if (use_entry[e]) information.noalias() += jacobian.transpose() * jacobian;
    fit.jacobian[e] = std::move(jacobian);
  }
  const auto with = [&](const Eigen::VectorXd& of_phases, const Eigen::VectorXd& others) {
    Eigen::VectorXd all(n);
    all << others.head(known), of_phases, others.tail(effects);
    return all;
  };
  fit.standardised = with(phases, fit.standardised);
  fit.prior_weight = with(Eigen::VectorXd::Ones(phases.size()), fit.prior_weight);
  fit.held.insert(fit.held.begin() + known, phases.size(), false);
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
  constexpr double kWorthwhile = 1;  // of twice the negative logarithm of the evidence
  constexpr double kLargestStep_rad = 0.5, kSmallestPart = 0.2;
  const PhaseModel phases(model);
  const std::vector<int>& lit = phases.lit();
  std::vector<FreeEffectParameter> all_free = free;
  const int last = static_cast<int>(start.effects.size());
  all_free.push_back({last, 0});
  all_free.push_back({last, 1});
  const auto phased_and_free = static_cast<Eigen::Index>(lit.size() + all_free.size());
  FitSettings settings;
  // What compares recordings of one speckle tells of movements far below a pixel, and nothing of
  // larger ones: it counts in the end only.
  for (int e = 0; e < model.entries(); ++e) {
    settings.use_entry.push_back(!model.ComparesSpeckle(e));
  }
  SetParameters parameters = start;
  parameters.effects.push_back({&vibration, law});
  // `reference`: whose covariance and derivatives with respect to the known parameters are kept.
  const auto fit_at = [&](const std::vector<double>& at_rad, const FitResult* reference) {
    const PhasedVibration phased(vibration.description(), at_rad);
    parameters.effects.back().effect = &phased;
    settings.renew_jacobian = reference == nullptr;
    settings.rounds.clear();
    if (reference == nullptr) settings.rounds = {{0, 0.1}, {0, 0}};
    FitResult fit = FitSet(model, parameters, all_free, settings, reference);
    Eigen::VectorXd standardised(lit.size());
    for (size_t i = 0; i < lit.size(); ++i) {
      standardised[static_cast<Eigen::Index>(i)] = at_rad[lit[i]] / kPhaseScale;
    }
    const std::vector<Eigen::MatrixXd> change = phases.Derivatives(fit, vibration, at_rad);
    fit = WithPhases(std::move(fit), change, settings.use_entry, standardised);
    fit.parameters.effects.back().effect = &vibration;
    return fit;
  };
  FitResult best = fit_at(phases_rad, nullptr);
  double part = 1;
  for (int turn = 0; turn < kMostTurns && part > kSmallestPart; ++turn) {
    parameters = best.parameters;
    std::vector<double> tried_rad = phases_rad;
    const bool search = turn == 0;
    if (search) {
      tried_rad = phases.Search(best, vibration, settings.use_entry, phases_rad);
    } else {
      // A step of all parameters together leads the phases; the fit mends the others.
      Eigen::VectorXd downhill = -best.prior_weight.cwiseProduct(best.standardised);
      for (int e = 0; e < model.entries(); ++e) {
        if (!settings.use_entry[e]) continue;
        downhill.noalias() += best.jacobian[e].transpose() * best.residual[e];
      }
      const Eigen::VectorXd step = (best.covariance * downhill)
                                       .segment(best.standardised.size() - phased_and_free,
                                                static_cast<Eigen::Index>(lit.size()));
      for (size_t i = 0; i < lit.size(); ++i) {
        tried_rad[lit[i]] += part * std::clamp(kPhaseScale * step[static_cast<Eigen::Index>(i)],
                                               -kLargestStep_rad, kLargestStep_rad);
      }
    }
    FitResult tried = fit_at(tried_rad, &best);
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
  parameters = best.parameters;
  settings.use_entry.assign(model.entries(), true);
  FollowedVibration followed;
  followed.fit = fit_at(phases_rad, nullptr);
  followed.fit.drawn = VibrationAtPhases(vibration, phases_rad);
  followed.phases_rad = std::move(phases_rad);
  return followed;
}

}  // namespace sightline
