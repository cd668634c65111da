// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/fit.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "render_worker/diagnosis/fit/broyden_update.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

namespace {

// Of finite differences: the first standardised, then such that the whitened expectation changes by
// this much. Parameters that do the same are thus moved by the same, and their curvature does not
// make them look different.
constexpr double kFirstStep = 0.05;
constexpr double kChange = 1;
constexpr double kLargestStep = 0.25;
constexpr double kNoChange = 0.1;  // part of kChange
constexpr int kMostAttempts = 4;
// Of deviations, in standard uncertainties: what needs more is not explained by them.
constexpr double kLargestDeviation = 3;

// The last round is repeated while it lowers the sum of squares by more and the likelihood gains.
constexpr double kUnfinished = 2;
constexpr int kMostRepeats = 6;

// Where an effect and a deviation do the same, only the prior tells them apart, whose curvature is
// small against the data's: more damping would keep them where they are.
constexpr double kLeastDamping = 1e-6;

// A typical value of something positive, over which nothing else is known.
bool IsLogarithmic(const EffectParameter& p) { return p.null_value > 0 && p.lower >= 0; }
double LogScale(const EffectParameter& p) { return std::log1p(p.prior_scale / p.null_value); }

// Deviations that change nothing but the amount of laser light.
bool IsAmount(std::string_view name) {
  return name == "power_relative" || name == "transmission_relative" ||
         name == "diffuse_albedo_relative" || name == "specular_f0_relative" ||
         name == "ggx_alpha_relative" || name == "quantum_efficiency_relative";
}

// Standardised parameters <-> SetParameters.
class ParameterVector {
 public:
  ParameterVector(const SetModel& model, const SetParameters& start,
                  const std::vector<FreeEffectParameter>& free)
      : model_(model),
        uncertainty_(model.set().description.uncertainty),
        start_(start),
        free_(free) {
    for (int i = 0; i < kDeviations; ++i) {
      if (DeviationAt(uncertainty_, i) > 0) deviations_.push_back(i);
    }
    shifts_ =
        uncertainty_.line_position_each_px > 0 ? static_cast<int>(model.position_ids().size()) : 0;
  }

  int size() const { return first_effect() + static_cast<int>(free_.size()); }
  int first_shift() const { return static_cast<int>(deviations_.size()); }
  int first_model_error() const { return first_shift() + shifts_; }
  int first_effect() const { return first_model_error() + ModelError::kCount; }
  int shifts() const { return shifts_; }
  std::string_view DeviationName(int i) const { return kDeviationNames[deviations_[i]]; }
  Eigen::VectorXd PriorWeights(const Eigen::VectorXd& x) const {
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(size());
    for (int i = first_effect(); i < size(); ++i) weights[i] = FitPriorWeight(x[i]);
    return weights;
  }
  double Penalty(const Eigen::VectorXd& x) const {
    double sum = x.head(first_effect()).squaredNorm();
    for (int i = first_effect(); i < size(); ++i) sum += FitPenalty(x[i]);
    return sum;
  }
  const EffectParameter& Parameter(size_t k) const {
    return start_.effects[free_[k].effect].effect->description().parameters[free_[k].parameter];
  }

  Eigen::VectorXd FromParameters(SetParameters parameters) {
    Eigen::VectorXd x(size());
    int i = 0;
    for (int d : deviations_) {
      x[i++] = DeviationAt(parameters.deviations, d) / DeviationAt(uncertainty_, d);
    }
    for (int s = 0; s < shifts_; ++s) {
      x[i++] =
          parameters.line_shift_px[model_.position_ids()[s]] / uncertainty_.line_position_each_px;
    }
    for (double error : parameters.model_error.standardised) x[i++] = error;
    for (size_t k = 0; k < free_.size(); ++k) {
      x[i++] = StandardisedParameter(
          Parameter(k), parameters.effects[free_[k].effect].parameters[free_[k].parameter]);
    }
    return x;
  }

  SetParameters ToParameters(const Eigen::VectorXd& x) {
    SetParameters parameters = start_;
    int i = 0;
    for (int d : deviations_) {
      DeviationAt(parameters.deviations, d) = x[i++] * DeviationAt(uncertainty_, d);
    }
    for (int s = 0; s < shifts_; ++s) {
      parameters.line_shift_px[model_.position_ids()[s]] =
          x[i++] * uncertainty_.line_position_each_px;
    }
    for (double& error : parameters.model_error.standardised) error = x[i++];
    for (size_t k = 0; k < free_.size(); ++k) {
      parameters.effects[free_[k].effect].parameters[free_[k].parameter] =
          ParameterFromStandardised(Parameter(k), x[i++]);
    }
    return parameters;
  }

  // Within the bounds of deviations and of effects' parameters.
  Eigen::VectorXd Bounded(const Eigen::VectorXd& x) {
    Eigen::VectorXd bounded = FromParameters(ToParameters(x));
    auto deviations = bounded.head(first_effect()).array();
    deviations = deviations.max(-kLargestDeviation).min(kLargestDeviation);
    return bounded;
  }

 private:
  const SetModel& model_;
  SetupDeviation uncertainty_;
  SetParameters start_;
  std::vector<FreeEffectParameter> free_;
  std::vector<int> deviations_;
  int shifts_ = 0;
};

struct State {
  Eigen::VectorXd x;
  Entries mean;
  Entries residual;        // whitened
  double chi_squared = 0;  // of the entries used
  double total = 0;        // with the prior
};

class Fitter {
 public:
  Fitter(const SetModel& model, const SetParameters& start,
         const std::vector<FreeEffectParameter>& free, const FitSettings& settings,
         const FitResult* reference)
      : model_(model),
        vector_(model, start, free),
        settings_(settings),
        reference_(reference),
        steps_(Eigen::VectorXd::Constant(vector_.size(), kFirstStep)) {}

  FitResult LineariseAt(const SetParameters& parameters) {
    State state;
    state.x = vector_.FromParameters(parameters);
    SetModel::Expectation expectation = model_.Expect(parameters, true);
    whitening_ = std::make_shared<Whitening>(expectation.covariance, Entries());
    state.mean = std::move(expectation.mean);
    for (const Eigen::VectorXd& mean : state.mean) {
      state.residual.push_back(Eigen::VectorXd::Zero(mean.size()));
    }
    Linearise(state, nullptr);
    return Result(state);
  }

  FitResult Run(const SetParameters& start, const std::vector<FreeEffectParameter>& free) {
    State state;
    state.x = vector_.Bounded(vector_.FromParameters(start));
    std::vector<FitSettings::Round> rounds = settings_.rounds;
    if (rounds.empty()) rounds.push_back({});
    const std::vector<Eigen::MatrixXd>* known =
        settings_.renew_jacobian ? nullptr : &reference_->jacobian;
    bool fresh = false;
    int repeats = 0;
    State best;
    std::shared_ptr<const Whitening> best_whitening;
    double best_likelihood = 0;  // twice its negative logarithm
    for (size_t r = 0; r < rounds.size(); ++r) {
      if (settings_.rounds.empty()) {
        whitening_ = reference_->whitening;
        state.mean = model_.Expect(vector_.ToParameters(state.x), false).mean;
      } else {
        Renew(state, rounds[r]);
      }
      Compare(state);
      const double start_of_round = state.total;
      double damping = kLeastDamping, at_renewal = state.total;
      bool renew = false;
      int renewals = 0;
      for (int iteration = 0; iteration < settings_.max_iterations; ++iteration) {
        // Derivatives with respect to the deviations change little within a round.
        Linearise(state, renew ? nullptr : iteration > 0 ? &jacobian_ : known);
        fresh = true;
        const double before = state.total;
        const double negligible = Negligible(state);
        const bool stepped = Step(state, damping);
        if (stepped) fresh = false;
        const bool stuck = !stepped || before - state.total < negligible;
        renew = stuck && renewals < settings_.most_renewals;
        if (stuck && (!renew || (renewals > 0 && at_renewal - state.total < 1))) break;
        if (!renew) continue;
        ++renewals;
        at_renewal = state.total;
        damping = kLeastDamping;
      }
      if (r + 1 < rounds.size() || settings_.rounds.empty()) continue;
      // Where the model fails, the covariance follows whatever the deviations are driven to.
      const double likelihood = state.total + LogDeterminant();
      if (repeats > 0 && likelihood > best_likelihood) {
        state = std::move(best);
        whitening_ = std::move(best_whitening);
        jacobian_.clear();
        fresh = false;
        break;
      }
      // Not there yet: once more, under the covariance of where it is now.
      if (start_of_round - state.total > kUnfinished && repeats++ < kMostRepeats) {
        best = state;
        best_whitening = whitening_;
        best_likelihood = likelihood;
        --r;
      }
    }
    if (!fresh) Linearise(state, jacobian_.empty() ? nullptr : &jacobian_);
    FitResult result = Result(state);
    result.free = free;
    return result;
  }

 private:
  bool Used(size_t entry) const {
    return settings_.use_entry.empty() || settings_.use_entry[entry];
  }

  const Entries& Observed() const {
    return settings_.observed != nullptr ? *settings_.observed : model_.observed();
  }

  // Of the covariances of the data that is used.
  double LogDeterminant() const {
    double sum = 0;
    for (size_t e = 0; e < model_.observed().size(); ++e) {
      if (Used(e)) sum += whitening_->LogDeterminant(static_cast<int>(e));
    }
    return sum;
  }

  void Renew(State& state, const FitSettings::Round& round) {
    SetModel::Expectation expectation = model_.Expect(vector_.ToParameters(state.x), true);
    Entries unexplained;
    for (size_t e = 0; e < expectation.mean.size(); ++e) {
      const Eigen::VectorXd& observed = Observed()[e];
      const Eigen::ArrayXd residual = (observed - expectation.mean[e]).array();
      const double background = observed.size() > 0 ? observed.minCoeff() : 0;
      unexplained.push_back(((round.of_signal * (observed.array() - background)).square() +
                             (round.of_residual * residual).square())
                                .sqrt()
                                .matrix());
    }
    whitening_ = std::make_shared<Whitening>(expectation.covariance, unexplained);
    state.mean = std::move(expectation.mean);
  }

  void Compare(State& state) const {
    state.residual.resize(state.mean.size());
    state.chi_squared = 0;
    for (size_t e = 0; e < state.mean.size(); ++e) {
      state.residual[e] = (*whitening_)(static_cast<int>(e), Observed()[e] - state.mean[e]);
      if (Used(e)) state.chi_squared += state.residual[e].squaredNorm();
    }
    state.total = state.chi_squared + vector_.Penalty(state.x);
  }

  // One column of the Jacobian by a finite difference from `origin`, the expectation at the state.
  void Differentiate(const State& state, const Entries& origin, bool middle_only, int i,
                     int attempt = 0) {
    Eigen::VectorXd moved = state.x;
    double step = steps_[i];
    const bool shift = i >= vector_.first_shift() && i < vector_.first_model_error();
    if (shift) {
      moved.segment(vector_.first_shift(), vector_.shifts()).array() += step;
    } else {
      moved[i] += step;
      // At an upper bound the other side counts.
      if (std::abs(vector_.Bounded(moved)[i] - moved[i]) > 1e-9) {
        moved[i] = state.x[i] - step;
        step = -step;
      }
    }
    const Entries means = model_.Expect(vector_.ToParameters(moved), false, middle_only).mean;
    double square = 0;
    for (size_t e = 0; e < means.size(); ++e) {
      int column = i;
      if (shift) {
        const int frame = model_.FramesOf(static_cast<int>(e)).front();
        const int id = model_.set().frames[frame].plate_position_id;
        if (id < 0) continue;
        const auto& ids = model_.position_ids();
        column = vector_.first_shift() +
                 static_cast<int>(std::find(ids.begin(), ids.end(), id) - ids.begin());
      }
      jacobian_[e].col(column) = (*whitening_)(static_cast<int>(e), means[e] - origin[e]) / step;
      square += jacobian_[e].col(column).squaredNorm();
    }
    const bool first = steps_[i] == kFirstStep;
    const double slope = std::sqrt(std::max(square, 1e-12));
    // What is rounded (a full pixel's number) stays as it is for a while: a longer step.
    const bool stays =
        i >= vector_.first_effect() && !first && slope * std::abs(step) < kNoChange * kChange;
    steps_[i] = std::min(kLargestStep, stays ? 5 * std::abs(step) : kChange / slope);
    const bool again = stays ? std::abs(step) < kLargestStep : first && steps_[i] < kFirstStep;
    if (again && attempt < kMostAttempts) {
      Differentiate(state, origin, middle_only, i, attempt + 1);
    }
  }

  // Finite differences of the whitened expectation. All line shifts move at once: an entry depends
  // on its own only. Amounts of light are computed once. `known`: derivatives of which those with
  // respect to the deviations are kept, or null.
  void Linearise(const State& state, const std::vector<Eigen::MatrixXd>* known) {
    const int n = vector_.size();
    std::vector<Eigen::MatrixXd> jacobian(state.mean.size());
    for (size_t e = 0; e < jacobian.size(); ++e) {
      jacobian[e].setZero(state.residual[e].size(), n);
      if (known != nullptr) {
        jacobian[e].leftCols(vector_.first_effect()) = (*known)[e].leftCols(vector_.first_effect());
      }
    }
    jacobian_ = std::move(jacobian);
    if (known == nullptr) {
      const bool middle_only = settings_.middle_only;
      const Entries origin =
          middle_only ? model_.Expect(vector_.ToParameters(state.x), false, true).mean : state.mean;
      int power = -1;
      for (int i = 0; i < vector_.first_shift(); ++i) {
        if (!IsAmount(vector_.DeviationName(i))) {
          Differentiate(state, origin, middle_only, i);
        } else if (power < 0) {
          power = i;
          Differentiate(state, origin, middle_only, i);
        } else {
          const double ratio = LogAmountStep(state, i) / LogAmountStep(state, power);
          for (Eigen::MatrixXd& j : jacobian_) j.col(i) = ratio * j.col(power);
        }
      }
      if (vector_.shifts() > 0) Differentiate(state, origin, middle_only, vector_.first_shift());
      for (int i = vector_.first_model_error(); i < vector_.first_effect(); ++i) {
        Differentiate(state, origin, middle_only, i);
      }
    }
    for (int i = vector_.first_effect(); i < n; ++i) Differentiate(state, state.mean, false, i);
    information_ = vector_.PriorWeights(state.x).asDiagonal();
    for (size_t e = 0; e < jacobian_.size(); ++e) {
      if (Used(e)) information_.noalias() += jacobian_[e].transpose() * jacobian_[e];
    }
    gradient_ = GradientAt(state);
  }

  // Downhill, with the derivatives kept.
  Eigen::VectorXd GradientAt(const State& state) const {
    Eigen::VectorXd gradient = -vector_.PriorWeights(state.x).cwiseProduct(state.x);
    for (size_t e = 0; e < jacobian_.size(); ++e) {
      if (Used(e)) gradient.noalias() += jacobian_[e].transpose() * state.residual[e];
    }
    return gradient;
  }

  // Change of the logarithm of the amount of light with parameter i.
  double LogAmountStep(const State& state, int i) {
    const auto amount = [&](const Eigen::VectorXd& x) {
      const FrameSetup frame = DeviatedFrame(model_.set(), 0, vector_.ToParameters(x).deviations);
      double efficiency = 0;
      for (const QuantumEfficiencyCurve& curve : frame.sensor.quantum_efficiency) {
        for (double value : curve.quantum_efficiency) efficiency += value;
      }
      return std::log(frame.laser.power_w * frame.lens.transmission * efficiency *
                      PlateBrdf(frame.surface, frame.plate.incidence_angle_rad));
    };
    Eigen::VectorXd moved = state.x;
    moved[i] += kFirstStep;
    return amount(moved) - amount(state.x);
  }

  // At a bound that the sum would like to go beyond.
  bool HeldByBound(const State& state, int i) {
    Eigen::VectorXd moved = state.x;
    moved[i] += gradient_[i] > 0 ? 1e-6 : -1e-6;
    return std::abs(vector_.Bounded(moved)[i] - moved[i]) > 5e-7;
  }

  State At(const Eigen::VectorXd& x) {
    State state;
    state.x = vector_.Bounded(x);
    state.mean = model_.Expect(vector_.ToParameters(state.x), false).mean;
    Compare(state);
    return state;
  }

  // Of the sum to be lowered: what is not worth another step.
  static double Negligible(const State& state) { return 0.05 + 1e-5 * state.total; }

  // Levenberg and Marquardt, with a second-order correction (Nocedal and Wright, Numerical
  // Optimization (2006), 18.3). False: no step lowers the sum, or none is worth its evaluation.
  bool Step(State& state, double& damping) {
    for (int attempt = 0; attempt < 6; ++attempt) {
      Eigen::MatrixXd damped = information_;
      damped.diagonal() *= 1 + damping;
      Eigen::VectorXd downhill = gradient_;
      for (int i = 0; i < damped.rows(); ++i) {
        if (!HeldByBound(state, i)) continue;
        damped.row(i).setZero();
        damped.col(i).setZero();
        damped(i, i) = 1;
        downhill[i] = 0;
      }
      const Eigen::LLT<Eigen::MatrixXd> solver(damped);
      const Eigen::VectorXd move = solver.solve(downhill);
      const double promised = move.dot(2 * downhill - information_ * move);
      if (promised < Negligible(state)) return false;
      State next = At(state.x + move);
      if (next.total >= state.total) {
        // Along a curved valley (an effect and a deviation do nearly the same) a straight step
        // leaves its floor: back to it before the step is judged.
        Eigen::VectorXd back = GradientAt(next);
        for (int i = 0; i < back.size(); ++i) {
          if (downhill[i] == 0) back[i] = 0;
        }
        next = At(next.x + solver.solve(back));
      }
      if (next.total < state.total) {
        Bend(next.x - state.x, state, next);
        state = std::move(next);
        damping = std::max(kLeastDamping, damping / 10);
        return true;
      }
      damping = std::max(damping * 10, 1e-2);
    }
    return false;
  }

  // The derivatives kept, to what was seen between two states.
  void Bend(const Eigen::VectorXd& moves, const State& from, const State& to) {
    // Recordings scatter, which is no slope; nor is it told by a short move.
    if (settings_.observed == nullptr || moves.norm() < kFirstStep) return;
    for (size_t e = 0; e < jacobian_.size(); ++e) {
      UpdateDerivatives(moves, from.residual[e] - to.residual[e], jacobian_[e]);
    }
  }

  FitResult Result(State& state) {
    FitResult result;
    result.parameters = vector_.ToParameters(state.x);
    const Eigen::LLT<Eigen::MatrixXd> solver(information_);
    result.covariance = solver.solve(Eigen::MatrixXd::Identity(state.x.size(), state.x.size()));
    result.log_determinant = 2 * solver.matrixLLT().diagonal().array().log().sum();
    for (int i = vector_.first_effect(); i < vector_.size(); ++i) {
      const EffectParameter& parameter = vector_.Parameter(i - vector_.first_effect());
      const double sigma = std::sqrt(result.covariance(i, i));
      const double slope = (ParameterFromStandardised(parameter, state.x[i] + 1e-3) -
                            ParameterFromStandardised(parameter, state.x[i] - 1e-3)) /
                           2e-3;
      result.effect_standard_errors.push_back(sigma * std::abs(slope));
    }
    for (int i = 0; i < vector_.size(); ++i) result.held.push_back(HeldByBound(state, i));
    result.chi_squared = state.chi_squared;
    result.prior = state.x.head(vector_.first_effect()).squaredNorm();
    for (size_t e = 0; e < state.residual.size(); ++e) {
      result.entry_chi_squared.push_back(state.residual[e].squaredNorm());
      if (Used(e)) result.data_count += static_cast<int>(state.residual[e].size());
    }
    result.data_log_determinant = LogDeterminant();
    result.standardised = state.x;
    result.prior_weight = vector_.PriorWeights(state.x);
    result.mean = std::move(state.mean);
    result.residual = std::move(state.residual);
    result.jacobian = std::move(jacobian_);
    result.whitening = whitening_;
    return result;
  }

  const SetModel& model_;
  ParameterVector vector_;
  FitSettings settings_;
  const FitResult* reference_;
  Eigen::VectorXd steps_;  // of finite differences
  std::shared_ptr<const Whitening> whitening_;
  std::vector<Eigen::MatrixXd> jacobian_;
  Eigen::MatrixXd information_;
  Eigen::VectorXd gradient_;
};

}  // namespace

std::vector<double> WholeNumbers(const EffectParameter& parameter) {
  if (parameter.name == "missing_bits") return {1, 2, 3, 4};
  if (parameter.name == "blades") return {5, 6, 7, 8, 9};
  return {};
}

std::vector<FreeEffectParameter> FreeParameters(const std::vector<ActiveEffect>& effects) {
  std::vector<FreeEffectParameter> free;
  for (size_t e = 0; e < effects.size(); ++e) {
    const std::vector<EffectParameter>& parameters = effects[e].effect->description().parameters;
    for (size_t k = 0; k < parameters.size(); ++k) {
      if (WholeNumbers(parameters[k]).empty()) {
        free.push_back({static_cast<int>(e), static_cast<int>(k)});
      }
    }
  }
  return free;
}

double StandardisedParameter(const EffectParameter& parameter, double value) {
  if (IsLogarithmic(parameter)) {
    return std::log(std::max(value, 1e-6 * parameter.null_value) / parameter.null_value) /
           LogScale(parameter);
  }
  return (value - parameter.null_value) / parameter.prior_scale;
}

double ParameterFromStandardised(const EffectParameter& parameter, double standardised) {
  const double value = IsLogarithmic(parameter)
                           ? parameter.null_value * std::exp(standardised * LogScale(parameter))
                           : parameter.null_value + standardised * parameter.prior_scale;
  return std::clamp(value, parameter.lower, parameter.upper);
}

double FitPenalty(double standardised) {
  const double square = standardised * standardised;
  return square <= 1 ? square : 1 + 2 * std::log((1 + square) / 2);
}

double FitPriorWeight(double standardised) {
  return 2 / (1 + std::max(1.0, standardised * standardised));
}

Whitening::Whitening(const std::vector<Eigen::MatrixXd>& covariance, const Entries& unexplained) {
  factors_.resize(covariance.size());
  for (size_t e = 0; e < covariance.size(); ++e) {
    Eigen::MatrixXd sum = covariance[e];
    if (!unexplained.empty()) sum.diagonal() += unexplained[e].cwiseAbs2();
    factors_[e].compute(sum);
    assert(factors_[e].info() == Eigen::Success);
  }
}

SetParameters ParametersAsDrawn(const FitResult& fit) {
  SetParameters parameters = fit.parameters;
  if (!fit.drawn) return parameters;
  const ActiveEffect law = parameters.effects.back();
  if (!fit.drawn_besides_law) parameters.effects.pop_back();
  // A realisation that is one of the law itself goes by the law's parameters.
  const bool by_law = !fit.drawn->description().parameters.empty();
  parameters.effects.push_back({fit.drawn.get(), by_law ? law.parameters : std::vector<double>()});
  return parameters;
}

double TwiceCost(const FitResult& fit) {
  return fit.chi_squared + fit.prior + fit.data_log_determinant + fit.log_determinant;
}

SetParameters AtStandardised(const SetModel& model, const SetParameters& from,
                             const Eigen::VectorXd& standardised) {
  ParameterVector vector(model, from, {});
  return vector.ToParameters(vector.Bounded(standardised.head(vector.size())));
}

FitResult LineariseSet(const SetModel& model, const SetParameters& parameters) {
  return Fitter(model, parameters, {}, {}, nullptr).LineariseAt(parameters);
}

FitResult FitSet(const SetModel& model, const SetParameters& start,
                 const std::vector<FreeEffectParameter>& free, const FitSettings& settings,
                 const FitResult* reference) {
  assert(reference != nullptr || (settings.renew_jacobian && !settings.rounds.empty()));
  return Fitter(model, start, free, settings, reference).Run(start, free);
}

}  // namespace sightline
