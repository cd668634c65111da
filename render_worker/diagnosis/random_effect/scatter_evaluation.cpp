// SPDX-License-Identifier: Apache-2.0
// One effect as an explanation of how recordings scatter.
#include "render_worker/diagnosis/random_effect/scatter_evaluation.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/random_effect/scatter_law.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"
#include "render_worker/diagnosis/random_effect/vibration_phases.h"

namespace sightline {
namespace {

// Gain that this may explain [nats]: more is no small error of the model.
constexpr double kMostUnknownScatter = 15;

// Of strengths: what is drawn is taken for normal and the same all over a block of the line, which
// in rendered sets costs up to half of vibration's and a third of texture's.
constexpr double kStrengthError = 0.35;

}  // namespace

Realisation RecordingScatter::RealisationOf(const ScatterLaw& law,
                                            const std::vector<double>& parameters,
                                            const Posterior& posterior) const {
  Realisation realisation(model_.set().frames.size());
  if (law.amplitude == Amplitude::kReflectance) {
    return RealisedReflectance(model_, posterior.amplitudes);
  }
  const Eigen::VectorXd blur =
      law.within ? law.within(parameters, posterior.amplitudes) : Eigen::VectorXd();
  for (int i = 0; i < lit(); ++i) {
    const int f = lit_.frames()[i];
    if (law.amplitude == Amplitude::kLight) {
      realisation.light_relative[f] = posterior.amplitudes[i];
    } else {
      realisation.shift_px[f] = posterior.amplitudes[i];
      realisation.blur_px2[f] = blur[i];
    }
  }
  return realisation;
}

// Every laser recording's own place and blur, with hardly any prior.
std::vector<RecordedMovement> RecordingScatter::MovementOf(const Linearisation& linear) const {
  constexpr double kShift_px = 10, kBlur_px2 = 10;
  const Eigen::Index n = lit();
  Eigen::MatrixXd information(2 * n, 2 * n);
  information << linear.inner, linear.within_cross, linear.within_cross.transpose(),
      linear.within_inner;
  information.diagonal().head(n).array() += 1 / (kShift_px * kShift_px);
  information.diagonal().tail(n).array() += 1 / (kBlur_px2 * kBlur_px2);
  Eigen::VectorXd slope(2 * n);
  slope << linear.slope + linear.within_cross * linear.within_origin,
      linear.within_slope + linear.within_inner * linear.within_origin;
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd found = solver.solve(slope);
  const Eigen::VectorXd variance = solver.solve(Eigen::MatrixXd::Identity(2 * n, 2 * n)).diagonal();
  // The place of a plate position is hardly told from a movement there.
  const double place_error_px = model_.set().description.uncertainty.line_position_each_px;
  std::vector<RecordedMovement> movements;
  for (int i = 0; i < lit(); ++i) {
    movements.push_back(
        {.exposure_time_s = model_.set().frames[lit_.frames()[i]].nominal.exposure_time_s,
         .shift_px = found[i],
         .shift_error_px = std::hypot(std::sqrt(variance[i]), place_error_px),
         .blur_px2 = std::max(0.0, found[n + i]),
         .blur_error_px2 = std::sqrt(variance[n + i])});
  }
  return movements;
}

// The fit by the model itself at the most probable realisation.
FitResult RecordingScatter::Describe(const Linearisation& linear, const ScatterLaw& law,
                                     const ScatterCandidate& candidate, const Posterior& posterior,
                                     const Realisation& realisation) {
  FitResult fit = null_;
  SetupDeviation uncertainty = model_.set().description.uncertainty;
  Eigen::Index at = 0;
  for (int i = 0; i < kDeviations; ++i) {
    const double scale = DeviationAt(uncertainty, i);
    if (scale > 0) DeviationAt(fit.parameters.deviations, i) = posterior.parameters[at++] * scale;
  }
  if (uncertainty.line_position_each_px > 0) {
    for (int id : model_.position_ids()) {
      fit.parameters.line_shift_px[id] =
          posterior.parameters[at++] * uncertainty.line_position_each_px;
    }
  }
  for (double& error : fit.parameters.model_error.standardised) error = posterior.parameters[at++];
  for (const FreeEffectParameter& free : null_.free) {
    ActiveEffect& active = fit.parameters.effects[free.effect];
    active.parameters[free.parameter] = ParameterFromStandardised(
        active.effect->description().parameters[free.parameter], posterior.parameters[at++]);
  }
  const RealisedEffect realised(realisation);
  fit.mean = model_.Expect(WithRealisation(fit.parameters, realised), false).mean;
  fit.drawn = std::make_shared<const RealisedEffect>(realisation);
  fit.drawn_besides_law = law.amplitude == Amplitude::kReflectance;
  const int first = static_cast<int>(fit.parameters.effects.size());
  fit.parameters.effects.push_back({candidate.effect, candidate.parameters});
  for (size_t k = 0; k < candidate.parameters.size(); ++k) {
    fit.free.push_back({first, static_cast<int>(k)});
    fit.effect_standard_errors.push_back(candidate.standard_errors[k]);
  }
  if (law.amplitude == Amplitude::kReflectance) {
    // A realisation does not express what varies within blocks.
    const Eigen::VectorXd residual =
        linear.residual - linear.jacobian * posterior.parameters -
        linear.change * posterior.amplitudes -
        linear.within * law.within(candidate.parameters, posterior.amplitudes);
    for (int e = 0; e < model_.entries(); ++e) {
      const int n = offset_[e + 1] - offset_[e];
      fit.residual[e] = residual.segment(offset_[e], n);
      const Eigen::LLT<Eigen::MatrixXd> solver(NullCovariance(e));
      fit.mean[e] = model_.observed()[e] - solver.matrixL() * fit.residual[e];
    }
  } else {
    if (!linear.covariance.empty()) {
      std::vector<Eigen::MatrixXd> covariance;
      for (int e = 0; e < model_.entries(); ++e) {
        const auto renewed = linear.covariance.find(e);
        covariance.push_back(renewed != linear.covariance.end() ? renewed->second
                                                                : NullCovariance(e));
      }
      fit.whitening = std::make_shared<const Whitening>(covariance, Entries());
      fit.data_log_determinant += linear.log_determinant;
    }
    for (int e = 0; e < model_.entries(); ++e) {
      fit.residual[e] = (*fit.whitening)(e, model_.observed()[e] - fit.mean[e]);
    }
  }
  const Eigen::MatrixXd columns = linear.change * posterior.factor;
  fit.chi_squared = 0;
  for (int e = 0; e < model_.entries(); ++e) {
    const int n = offset_[e + 1] - offset_[e];
    Eigen::MatrixXd jacobian(n, linear.jacobian.cols() + columns.cols());
    jacobian << linear.jacobian.middleRows(offset_[e], n), columns.middleRows(offset_[e], n);
    fit.jacobian[e] = std::move(jacobian);
    fit.entry_chi_squared[e] = fit.residual[e].squaredNorm();
    fit.chi_squared += fit.entry_chi_squared[e];
  }
  fit.standardised.resize(posterior.parameters.size() + posterior.amplitudes.size());
  fit.standardised << posterior.parameters, posterior.standardised_amplitudes;
  fit.prior_weight.resize(fit.standardised.size());
  fit.prior_weight << null_.prior_weight, Eigen::VectorXd::Ones(posterior.amplitudes.size());
  Eigen::MatrixXd information = fit.prior_weight.asDiagonal();
  for (const Eigen::MatrixXd& jacobian : fit.jacobian) {
    information.noalias() += jacobian.transpose() * jacobian;
  }
  fit.covariance = information.llt().solve(
      Eigen::MatrixXd::Identity(fit.standardised.size(), fit.standardised.size()));
  fit.prior = fit.standardised.squaredNorm();
  fit.log_determinant = posterior.log_determinant;
  return fit;
}

ScatterCandidate RecordingScatter::Evaluate(const Effect& effect, Realisation& at) {
  const ScatterLaw law = ScatterLawOf(effect.description().id, model_);
  // Again where that has led to, if it is anywhere.
  constexpr double kWorthwhile = 3;
  const bool moves = law.amplitude == Amplitude::kShift;
  const int rounds = moves ? 4 : law.amplitude == Amplitude::kReflectance ? 1 : 2;
  ScatterCandidate best;
  Realisation from = at;
  double baseline = 0, before = 0;
  for (int round = 0; round < rounds; ++round) {
    Linearisation linear = Linearise(law.amplitude, from);
    Peak peak = Search(linear, law, effect);
    if (round == 0) {
      // What the uncertainty of the null's own scatter explains is no effect.
      std::vector<double> none = peak.parameters;
      none[0] = 0;
      baseline = std::clamp(Gain(linear, law, none), 0.0, kMostUnknownScatter);
    }
    const bool single =
        moves && peak.gain - baseline > kWorthwhile && IsSeenInSingleRecordings(MovementOf(linear));
    std::vector<double> phases_rad;
    if (single) {
      linear = LineariseAboutFreeMovement(std::move(linear));
      peak = Search(linear, law, effect);
    }
    if (single && effect.description().id == kVibration) {
      const std::vector<RecordedMovement> movements = MovementOf(linear);
      const VibrationFit fit = FitVibration(movements);
      peak.parameters = {fit.amplitude_px, fit.frequency_hz};
      phases_rad = PhasesOfMovements(model_, peak.parameters, movements);
      peak.standard_errors = {fit.amplitude_error_px, fit.frequency_error_hz};
    }
    const Posterior posterior = MostProbable(linear, law, peak.parameters);
    from = RealisationOf(law, peak.parameters, posterior);
    ScatterCandidate candidate;
    candidate.effect = &effect;
    candidate.parameters = peak.parameters;
    candidate.standard_errors = peak.standard_errors;
    if (law.amplitude != Amplitude::kLight && !single) {
      candidate.standard_errors[0] =
          std::hypot(candidate.standard_errors[0], kStrengthError * candidate.parameters[0]);
    }
    candidate.log_evidence = peak.log_evidence - baseline;
    candidate.largest_gain = peak.gain - baseline;
    candidate.light_relative = from.light_relative;
    candidate.shift_px = from.shift_px;
    candidate.phases_rad = std::move(phases_rad);
    candidate.fit = Describe(linear, law, candidate, posterior, from);
    // Far off, straight lines lead astray: the model itself decides.
    if (round == 0 || TwiceCost(candidate.fit) < TwiceCost(best.fit)) {
      best = std::move(candidate);
      at = from;
    }
    const double gained = peak.gain - before;
    before = peak.gain;
    if (single || peak.gain - baseline <= kWorthwhile || (round > 0 && std::abs(gained) < 0.5))
      break;
  }
  return best;
}

}  // namespace sightline
