// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/fit.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/fit/broyden_update.h"
#include "render_worker/diagnosis/fit/finite_differences.h"
#include "render_worker/diagnosis/fit/fit_problem.h"

namespace sightline {

namespace {

// The last round is repeated while it lowers the sum by more than this (chosen: one nat of
// log-likelihood) and the likelihood grows, at most so often.
constexpr double kUnfinished = 2;
constexpr int kMostRepeats = 6;

// Smallest Levenberg-Marquardt damping. Where an effect and a deviation do the same, only the prior
// separates them. Its curvature is small against that of the data, so larger damping would stop the
// fit along that valley.
constexpr double kLeastDamping = 1e-6;
// Damping changes by this factor after a step, as in Marquardt (1963), and is at least
// kRetryDamping after a rejected one.
constexpr double kDampingFactor = 10;
constexpr double kRetryDamping = 1e-2;
// Attempts per step. Chosen: damping has then grown to 100, and the step is a short one along the
// gradient.
constexpr int kMostAttemptsOfStep = 6;

// Decrease of the sum that is not worth a further step: absolute, and relative to the sum. Chosen:
// well below the differences in evidence that matter (one nat of log-likelihood is 2).
constexpr double kNegligible = 0.05;
constexpr double kNegligible_relative = 1e-5;
// Decrease since the last renewal of the derivatives that justifies another one.
constexpr double kWorthRenewal = 1;

// Standardised distance by which a bound is probed, and half of it, beyond rounding.
constexpr double kBoundProbe = 1e-6;
constexpr double kBoundTolerance = 5e-7;
// Standardised half-width of the central difference that converts standard errors.
constexpr double kUnitProbe = 1e-3;

class LevenbergMarquardt {
 public:
  LevenbergMarquardt(const SetModel& model, const SetParameters& start,
                     const std::vector<FreeEffectParameter>& free, const FitSettings& settings,
                     const FitResult* reference)
      : problem_(model, start, free, settings), differences_(problem_), reference_(reference) {}

  FitResult LineariseAt(const SetParameters& parameters) {
    FitState state;
    state.x = problem_.vector().FromParameters(parameters);
    SetModel::Expectation expectation = problem_.model().Expect(parameters, true);
    problem_.set_whitening(std::make_shared<Whitening>(expectation.covariance, BlockVectors()));
    state.mean = std::move(expectation.mean);
    for (const Eigen::VectorXd& mean : state.mean) {
      state.residual.push_back(Eigen::VectorXd::Zero(mean.size()));
    }
    Linearise(state, nullptr);
    return Result(state);
  }

  FitResult Run(const SetParameters& start, const std::vector<FreeEffectParameter>& free) {
    const FitSettings& settings = problem_.settings();
    FitState state;
    state.x = problem_.vector().Bounded(problem_.vector().FromParameters(start));
    std::vector<FitSettings::Round> rounds = settings.rounds;
    if (rounds.empty()) rounds.push_back({});
    int repeats = 0;
    FitState best;
    std::shared_ptr<const Whitening> best_whitening;
    double best_likelihood = 0;  // twice its negative logarithm
    for (size_t r = 0; r < rounds.size(); ++r) {
      if (settings.rounds.empty()) {
        problem_.set_whitening(reference_->whitening);
        state.mean = problem_.model().Expect(problem_.vector().ToParameters(state.x), false).mean;
      } else {
        problem_.RenewCovariance(rounds[r], state);
      }
      problem_.Compare(state);
      const double start_of_round = state.total;
      Iterate(state);
      if (r + 1 < rounds.size() || settings.rounds.empty()) continue;
      // A model that does not fit can lower chi squared by widening its covariance. The likelihood
      // of the repeated round decides.
      const double likelihood = state.total + problem_.LogDeterminant();
      if (repeats > 0 && likelihood > best_likelihood) {
        state = std::move(best);
        problem_.set_whitening(std::move(best_whitening));
        jacobian_.clear();
        current_ = false;
        break;
      }
      // Not converged: repeat the round with the covariance at the present parameters.
      if (start_of_round - state.total > kUnfinished && repeats++ < kMostRepeats) {
        best = state;
        best_whitening = problem_.whitening();
        best_likelihood = likelihood;
        --r;
      }
    }
    if (!current_) Linearise(state, jacobian_.empty() ? nullptr : &jacobian_);
    FitResult result = Result(state);
    result.free = free;
    return result;
  }

 private:
  // Steps of one round. Derivatives with respect to the set-up's parameters change little within a
  // round, so they are computed at its start and again only if steps stop too early.
  void Iterate(FitState& state) {
    const FitSettings& settings = problem_.settings();
    const FitJacobian* at_start = settings.renew_jacobian ? nullptr : &reference_->jacobian;
    double damping = kLeastDamping, at_renewal = state.total;
    bool renew = false;
    int renewals = 0;
    for (int iteration = 0; iteration < settings.max_iterations; ++iteration) {
      Linearise(state, renew ? nullptr : iteration > 0 ? &jacobian_ : at_start);
      const double before = state.total;
      const double negligible = Negligible(state);
      const bool stepped = Step(state, damping);
      if (stepped) current_ = false;
      const bool stuck = !stepped || before - state.total < negligible;
      renew = stuck && renewals < settings.most_renewals;
      if (stuck && (!renew || (renewals > 0 && at_renewal - state.total < kWorthRenewal))) break;
      if (!renew) continue;
      ++renewals;
      at_renewal = state.total;
      damping = kLeastDamping;
    }
  }

  // Jacobian, information matrix H = prior + J'J and gradient at a state. `known`: see
  // FiniteDifferences.
  void Linearise(const FitState& state, const FitJacobian* known) {
    jacobian_ = differences_.At(state, known);
    information_ = problem_.vector().PriorWeights(state.x).asDiagonal();
    for (size_t e = 0; e < jacobian_.size(); ++e) {
      if (problem_.Used(e)) information_.noalias() += jacobian_[e].transpose() * jacobian_[e];
    }
    gradient_ = DescentAt(state);
    current_ = true;
  }

  // Half the negative gradient of the sum, with the present Jacobian.
  Eigen::VectorXd DescentAt(const FitState& state) const {
    Eigen::VectorXd gradient = -problem_.vector().PriorWeights(state.x).cwiseProduct(state.x);
    for (size_t e = 0; e < jacobian_.size(); ++e) {
      if (problem_.Used(e)) gradient.noalias() += jacobian_[e].transpose() * state.residual[e];
    }
    return gradient;
  }

  // True: parameter i is at a bound and descent leads beyond it.
  bool HasActiveBound(const FitState& state, int i) const {
    Eigen::VectorXd moved = state.x;
    moved[i] += gradient_[i] > 0 ? kBoundProbe : -kBoundProbe;
    return std::abs(problem_.vector().Bounded(moved)[i] - moved[i]) > kBoundTolerance;
  }

  static double Negligible(const FitState& state) {
    return kNegligible + kNegligible_relative * state.total;
  }

  // One step of Levenberg and Marquardt. False: no step lowers the sum, or the decrease that the
  // linear model predicts is negligible.
  bool Step(FitState& state, double& damping) {
    for (int attempt = 0; attempt < kMostAttemptsOfStep; ++attempt) {
      Eigen::MatrixXd damped = information_;
      damped.diagonal() *= 1 + damping;
      Eigen::VectorXd downhill = gradient_;
      for (int i = 0; i < damped.rows(); ++i) {
        if (!HasActiveBound(state, i)) continue;
        damped.row(i).setZero();
        damped.col(i).setZero();
        damped(i, i) = 1;
        downhill[i] = 0;
      }
      const Eigen::LLT<Eigen::MatrixXd> solver(damped);
      const Eigen::VectorXd move = solver.solve(downhill);
      const double predicted = move.dot(2 * downhill - information_ * move);
      if (predicted < Negligible(state)) return false;
      FitState next = problem_.At(state.x + move);
      if (next.total >= state.total) {
        // Second-order correction: along a curved valley (an effect and a deviation do nearly the
        // same) a straight step leaves the floor. Return to it before the step is rejected.
        Eigen::VectorXd back = DescentAt(next);
        for (int i = 0; i < back.size(); ++i) {
          if (downhill[i] == 0) back[i] = 0;
        }
        next = problem_.At(next.x + solver.solve(back));
      }
      if (next.total < state.total) {
        UpdateJacobian(next.x - state.x, state, next);
        state = std::move(next);
        damping = std::max(kLeastDamping, damping / kDampingFactor);
        return true;
      }
      damping = std::max(damping * kDampingFactor, kRetryDamping);
    }
    return false;
  }

  // Broyden's update, only when noise-free data are fitted and only after steps long enough to show
  // a slope.
  void UpdateJacobian(const Eigen::VectorXd& moves, const FitState& from, const FitState& to) {
    if (problem_.settings().observed == nullptr || moves.norm() < kFirstStep) return;
    for (size_t e = 0; e < jacobian_.size(); ++e) {
      UpdateDerivatives(moves, from.residual[e] - to.residual[e], jacobian_[e]);
    }
  }

  // Moves expectation, residual and Jacobian into the result.
  FitResult Result(FitState& state) {
    const ParameterVector& vector = problem_.vector();
    FitResult result;
    result.parameters = vector.ToParameters(state.x);
    const Eigen::LLT<Eigen::MatrixXd> solver(information_);
    result.covariance = solver.solve(Eigen::MatrixXd::Identity(state.x.size(), state.x.size()));
    result.log_determinant = 2 * solver.matrixLLT().diagonal().array().log().sum();
    for (int i = vector.first_effect(); i < vector.size(); ++i) {
      const EffectParameter& parameter = vector.Parameter(i - vector.first_effect());
      const double sigma = std::sqrt(result.covariance(i, i));
      const double slope = (ParameterFromStandardised(parameter, state.x[i] + kUnitProbe) -
                            ParameterFromStandardised(parameter, state.x[i] - kUnitProbe)) /
                           (2 * kUnitProbe);
      result.effect_standard_errors.push_back(sigma * std::abs(slope));
    }
    for (int i = 0; i < vector.size(); ++i) result.at_bound.push_back(HasActiveBound(state, i));
    result.chi_squared = state.chi_squared;
    result.prior = state.x.head(vector.first_effect()).squaredNorm();
    for (size_t e = 0; e < state.residual.size(); ++e) {
      result.block_chi_squared.push_back(state.residual[e].squaredNorm());
      if (problem_.Used(e)) result.data_count += static_cast<int>(state.residual[e].size());
    }
    result.data_log_determinant = problem_.LogDeterminant();
    result.standardised = state.x;
    result.prior_weight = vector.PriorWeights(state.x);
    result.mean = std::move(state.mean);
    result.residual = std::move(state.residual);
    result.jacobian = std::move(jacobian_);
    result.whitening = problem_.whitening();
    return result;
  }

  FitProblem problem_;
  FiniteDifferences differences_;
  const FitResult* reference_;
  FitJacobian jacobian_;
  Eigen::MatrixXd information_;
  Eigen::VectorXd gradient_;  // half the negative gradient of the sum
  bool current_ = false;      // the three above belong to the present state
};

}  // namespace

SetParameters ParametersWithRandomEffect(const FitResult& fit) {
  SetParameters parameters = fit.parameters;
  if (!fit.random_effect) return parameters;
  const ActiveEffect distribution = parameters.effects.back();
  if (!fit.random_effect_is_additional) parameters.effects.pop_back();
  // A realised effect with parameters has those of the distribution.
  const bool shared = !fit.random_effect->description().parameters.empty();
  parameters.effects.push_back(
      {fit.random_effect.get(), shared ? distribution.parameters : std::vector<double>()});
  return parameters;
}

double TwiceCost(const FitResult& fit) {
  return fit.chi_squared + fit.prior + fit.data_log_determinant + fit.log_determinant;
}

FitResult LineariseSet(const SetModel& model, const SetParameters& parameters) {
  return LevenbergMarquardt(model, parameters, {}, {}, nullptr).LineariseAt(parameters);
}

FitResult FitSet(const SetModel& model, const SetParameters& start,
                 const std::vector<FreeEffectParameter>& free, const FitSettings& settings,
                 const FitResult* reference) {
  assert(reference != nullptr || (settings.renew_jacobian && !settings.rounds.empty()));
  return LevenbergMarquardt(model, start, free, settings, reference).Run(start, free);
}

}  // namespace sightline
