// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/evaluate_random_effect.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/evidence_search.h"
#include "render_worker/diagnosis/random_effect/free_movement.h"
#include "render_worker/diagnosis/random_effect/linear_mixed_model.h"

namespace sightline {

namespace {

// Relative error of the variance that speckle and noise alone cause between recordings. The model's
// approximations make it uncertain.
constexpr double kNullVarianceError = 0.3;

// Log likelihood ratio that this error may explain at most [nats]; more is no small error of the
// model.
constexpr double kMostByNullVariance = 15;

// Relative error of strengths: amplitudes are taken for normal and constant over a segment of the
// line. In rendered sets this costs up to half of a vibration's strength and a third of a
// texture's.
constexpr double kStrengthError = 0.35;

// Log likelihood ratio from which on another round is worth its time, and its least increase
// [nats].
constexpr double kWorthAnotherRound = 3, kLeastIncrease = 0.5;

// A random effect about one linearisation.
struct LinearisedEffect {
  const LinearisationBasis& basis;
  const RandomEffect& law;
  LinearisedSet linear;

  // Factor of K + E: K is the covariance of the amplitudes, E the error of the variance that
  // speckle and noise alone cause, 1 / (V'PV)_ii per amplitude.
  Eigen::MatrixXd Factor(const std::vector<double>& parameters) const {
    const Eigen::MatrixXd factor = law.CovarianceFactor(parameters);
    Eigen::MatrixXd covariance = factor * factor.transpose();
    covariance.diagonal() +=
        kNullVarianceError * linear.projected.inner.diagonal().cwiseMax(1e-6).cwiseInverse();
    return covariance.llt().matrixL();
  }

  // Expected variance within recordings over that at the linearisation point; empty: none.
  Eigen::VectorXd Offset(const std::vector<double>& parameters) const {
    const Eigen::VectorXd within = law.VarianceWithin(parameters, linear.amplitudes);
    if (within.size() == 0) return within;
    return within - linear.variance_within;
  }

  // Logarithm of the likelihood over that of the null model [nats].
  double Gain(const std::vector<double>& parameters) const {
    return LogMarginalLikelihood(linear.projected, Offset(parameters), Factor(parameters),
                                 basis.reference);
  }

  EvidencePeak Search(const Effect& effect) const {
    EvidenceSearchSettings settings;
    settings.largest_shape = law.largest_shape();
    // Every exposure time that holds whole periods is blind to a frequency.
    settings.many_shapes = law.amplitude() == Amplitude::kShift;
    return SearchEvidence(
        effect.description().parameters,
        [&](const std::vector<double>& parameters) { return Gain(parameters); }, settings);
  }
};

// Posterior given an effect's parameters, with the factor it is standardised by.
struct EffectPosterior {
  Eigen::MatrixXd factor;
  MixedModelPosterior mean;
};

EffectPosterior PosteriorAt(const LinearisedEffect& linearised,
                            const std::vector<double>& parameters) {
  const FitResult& fit = linearised.basis.fit;
  EffectPosterior posterior;
  posterior.factor = linearised.Factor(parameters);
  posterior.mean = PosteriorOf(linearised.linear.model, linearised.linear.projected,
                               linearised.Offset(parameters), posterior.factor);
  // Parameters at a bound stay there.
  for (size_t i = 0; i < fit.at_bound.size(); ++i) {
    const auto held = static_cast<Eigen::Index>(i);
    if (fit.at_bound[i]) posterior.mean.nuisance[held] = fit.standardised[held];
  }
  return posterior;
}

// Parameters of the fit with standardised values in the order of FitResult::standardised.
SetParameters ParametersAt(const LinearisationBasis& basis, const Eigen::VectorXd& standardised) {
  SetParameters parameters = basis.fit.parameters;
  SetupDeviation uncertainty = basis.model.set().description.uncertainty;
  Eigen::Index at = 0;
  for (int i = 0; i < kDeviations; ++i) {
    const double scale = DeviationAt(uncertainty, i);
    if (scale > 0) DeviationAt(parameters.deviations, i) = standardised[at++] * scale;
  }
  if (uncertainty.line_position_each_px > 0) {
    for (int id : basis.model.position_ids()) {
      parameters.line_shift_px[id] = standardised[at++] * uncertainty.line_position_each_px;
    }
  }
  for (double& error : parameters.model_error.standardised) error = standardised[at++];
  for (const FreeEffectParameter& free : basis.fit.free) {
    ActiveEffect& active = parameters.effects[free.effect];
    active.parameters[free.parameter] = ParameterFromStandardised(
        active.effect->description().parameters[free.parameter], standardised[at++]);
  }
  return parameters;
}

// A realisation does not express how light varies within segments: mean and residual are those of
// the linearised model.
void SetLinearResidual(const LinearisedEffect& linearised, const std::vector<double>& parameters,
                       const MixedModelPosterior& posterior, FitResult& fit) {
  const LinearisationBasis& basis = linearised.basis;
  const LinearMixedModel& linear = linearised.linear.model;
  const Eigen::VectorXd residual =
      linear.residual - linear.nuisance * posterior.nuisance -
      linear.change * posterior.amplitudes -
      linear.offset_change * linearised.law.VarianceWithin(parameters, posterior.amplitudes);
  for (int e = 0; e < basis.model.blocks(); ++e) {
    fit.residual[e] = residual.segment(basis.offset[e], basis.size(e));
    const Eigen::LLT<Eigen::MatrixXd> solver(CovarianceOfBlock(basis, e));
    fit.mean[e] = basis.model.observed()[e] - solver.matrixL() * fit.residual[e];
  }
}

// Residual of the full model's expectation, under the covariance of the linearisation.
void SetResidual(const LinearisedEffect& linearised, FitResult& fit) {
  const LinearisationBasis& basis = linearised.basis;
  const LinearisedSet& linear = linearised.linear;
  if (!linear.covariance.empty()) {
    std::vector<Eigen::MatrixXd> covariance;
    for (int e = 0; e < basis.model.blocks(); ++e) {
      const auto renewed = linear.covariance.find(e);
      covariance.push_back(renewed != linear.covariance.end() ? renewed->second
                                                              : CovarianceOfBlock(basis, e));
    }
    fit.whitening = std::make_shared<const Whitening>(covariance, BlockVectors());
    fit.data_log_determinant += linear.model.log_determinant;
  }
  for (int e = 0; e < basis.model.blocks(); ++e) {
    fit.residual[e] = (*fit.whitening)(e, basis.model.observed()[e] - fit.mean[e]);
  }
}

// Standardised amplitudes as further parameters of the fit, behind those it has.
void AddAmplitudes(const LinearisedEffect& linearised, const EffectPosterior& posterior,
                   FitResult& fit) {
  const LinearisationBasis& basis = linearised.basis;
  const LinearMixedModel& linear = linearised.linear.model;
  const Eigen::VectorXd& nuisance = posterior.mean.nuisance;
  const Eigen::VectorXd& amplitudes = posterior.mean.standardised_amplitudes;
  const Eigen::MatrixXd columns = linear.change * posterior.factor;
  fit.chi_squared = 0;
  for (int e = 0; e < basis.model.blocks(); ++e) {
    const int n = basis.size(e);
    Eigen::MatrixXd jacobian(n, linear.nuisance.cols() + columns.cols());
    jacobian << linear.nuisance.middleRows(basis.offset[e], n),
        columns.middleRows(basis.offset[e], n);
    fit.jacobian[e] = std::move(jacobian);
    fit.block_chi_squared[e] = fit.residual[e].squaredNorm();
    fit.chi_squared += fit.block_chi_squared[e];
  }
  fit.standardised.resize(nuisance.size() + amplitudes.size());
  fit.standardised << nuisance, amplitudes;
  fit.prior_weight.resize(fit.standardised.size());
  fit.prior_weight << basis.fit.prior_weight, Eigen::VectorXd::Ones(amplitudes.size());
  Eigen::MatrixXd information = fit.prior_weight.asDiagonal();
  for (const Eigen::MatrixXd& jacobian : fit.jacobian) {
    information.noalias() += jacobian.transpose() * jacobian;
  }
  fit.covariance = information.llt().solve(
      Eigen::MatrixXd::Identity(fit.standardised.size(), fit.standardised.size()));
  fit.prior = fit.standardised.squaredNorm();
  fit.log_determinant = posterior.mean.log_determinant;
}

// The fit by the full model at the most probable realisation.
FitResult FitAt(const LinearisedEffect& linearised, const RandomEffectCandidate& candidate,
                const EffectPosterior& posterior, const Realisation& realisation) {
  const LinearisationBasis& basis = linearised.basis;
  const bool of_segments = linearised.law.amplitude() == Amplitude::kReflectance;
  FitResult fit = basis.fit;
  fit.parameters = ParametersAt(basis, posterior.mean.nuisance);
  fit.mean = ExpectAt(basis.model, fit.parameters, realisation, false).mean;
  fit.random_effect = std::make_shared<const RealisedEffect>(realisation);
  fit.random_effect_is_additional = of_segments;
  const int last = static_cast<int>(fit.parameters.effects.size());
  fit.parameters.effects.push_back({candidate.effect, candidate.parameters});
  for (size_t k = 0; k < candidate.parameters.size(); ++k) {
    fit.free.push_back({last, static_cast<int>(k)});
    fit.effect_standard_errors.push_back(candidate.standard_errors[k]);
  }
  if (of_segments) {
    SetLinearResidual(linearised, candidate.parameters, posterior.mean, fit);
  } else {
    SetResidual(linearised, fit);
  }
  AddAmplitudes(linearised, posterior, fit);
  return fit;
}

// Peak of the marginal likelihood. If single recordings show a movement, it is searched about their
// own displacements, and parameters and phases are those of their joint distribution.
struct FoundParameters {
  EvidencePeak peak;
  bool seen_in_single_recordings = false;
  std::vector<double> phases_rad;
};

FoundParameters RefineBySingleRecordings(const Effect& effect, EvidencePeak peak, double baseline,
                                         LinearisedEffect& linearised) {
  FoundParameters found;
  found.peak = std::move(peak);
  found.seen_in_single_recordings =
      linearised.law.amplitude() == Amplitude::kShift &&
      found.peak.gain - baseline > kWorthAnotherRound &&
      IsSeenInSingleRecordings(FreeMovements(linearised.basis, linearised.linear));
  if (!found.seen_in_single_recordings) return found;
  linearised.linear = LineariseAboutFreeMovements(linearised.basis, std::move(linearised.linear));
  found.peak = linearised.Search(effect);
  const std::optional<MovementParameters> movement =
      linearised.law.FitMovements(FreeMovements(linearised.basis, linearised.linear));
  if (!movement) return found;
  found.peak.parameters = movement->parameters;
  found.peak.standard_errors = movement->standard_errors;
  found.phases_rad = movement->phases_rad;
  return found;
}

int MostRounds(Amplitude amplitude) {
  switch (amplitude) {
    case Amplitude::kShift:
      return 4;
    case Amplitude::kLight:
      return 2;
    case Amplitude::kReflectance:
      break;
  }
  return 1;
}

EvaluatedRandomEffect Evaluated(const LinearisedEffect& linearised, const Effect& effect,
                                FoundParameters found, double baseline) {
  const EvidencePeak& peak = found.peak;
  const EffectPosterior posterior = PosteriorAt(linearised, peak.parameters);
  EvaluatedRandomEffect evaluated{
      .candidate = {},
      .realisation = linearised.law.RealisationOf(peak.parameters, posterior.mean.amplitudes)};
  RandomEffectCandidate& candidate = evaluated.candidate;
  candidate.effect = &effect;
  candidate.parameters = peak.parameters;
  candidate.standard_errors = peak.standard_errors;
  if (linearised.law.amplitude() != Amplitude::kLight && !found.seen_in_single_recordings) {
    candidate.standard_errors[0] =
        std::hypot(candidate.standard_errors[0], kStrengthError * candidate.parameters[0]);
  }
  candidate.log_evidence = peak.log_evidence - baseline;
  candidate.largest_gain = peak.gain - baseline;
  candidate.light_relative = evaluated.realisation.light_relative;
  candidate.shift_px = evaluated.realisation.shift_px;
  candidate.phases_rad = std::move(found.phases_rad);
  candidate.fit = FitAt(linearised, candidate, posterior, evaluated.realisation);
  return evaluated;
}

}  // namespace

EvaluatedRandomEffect EvaluateRandomEffect(const LinearisationBasis& basis, const Effect& effect,
                                           const RandomEffect& law, const Realisation& start) {
  EvaluatedRandomEffect best{.candidate = {}, .realisation = start};
  Realisation from = start;
  double baseline = 0, before = 0;
  for (int round = 0; round < MostRounds(law.amplitude()); ++round) {
    LinearisedEffect linearised{
        .basis = basis, .law = law, .linear = Linearise(basis, law.amplitude(), from)};
    EvidencePeak peak = linearised.Search(effect);
    if (round == 0) {
      // The error of the null model's own variance explains this much without the effect.
      std::vector<double> none = peak.parameters;
      none[0] = 0;
      baseline = std::clamp(linearised.Gain(none), 0.0, kMostByNullVariance);
    }
    FoundParameters found = RefineBySingleRecordings(effect, std::move(peak), baseline, linearised);
    const bool single = found.seen_in_single_recordings;
    const double gain = found.peak.gain;
    EvaluatedRandomEffect evaluated = Evaluated(linearised, effect, std::move(found), baseline);
    from = evaluated.realisation;
    // Far from the linearisation point the linear prediction is wrong: the full model decides.
    if (round == 0 || TwiceCost(evaluated.candidate.fit) < TwiceCost(best.candidate.fit)) {
      best = std::move(evaluated);
    }
    const double gained = gain - before;
    before = gain;
    if (single || gain - baseline <= kWorthAnotherRound ||
        (round > 0 && std::abs(gained) < kLeastIncrease)) {
      break;
    }
  }
  return best;
}

}  // namespace sightline
