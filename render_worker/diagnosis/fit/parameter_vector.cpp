// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/parameter_vector.h"

#include "render_worker/diagnosis/fit/parameter_prior.h"

namespace sightline {

namespace {

// Bound of deviations [standard uncertainties]. Chosen: 99.7 % of a normal distribution lies
// within; a larger discrepancy is not explained by the stated uncertainty.
constexpr double kLargestDeviation = 3;

}  // namespace

std::vector<FreeEffectParameter> FreeParameters(const std::vector<ActiveEffect>& effects) {
  std::vector<FreeEffectParameter> free;
  for (size_t e = 0; e < effects.size(); ++e) {
    const std::vector<EffectParameter>& parameters = effects[e].effect->description().parameters;
    for (size_t k = 0; k < parameters.size(); ++k) {
      if (parameters[k].discrete_values.empty()) {
        free.push_back({static_cast<int>(e), static_cast<int>(k)});
      }
    }
  }
  return free;
}

ParameterVector::ParameterVector(const SetModel& model, const SetParameters& start,
                                 const std::vector<FreeEffectParameter>& free)
    : model_(model), start_(start), free_(free) {
  SetupDeviation uncertainty = model.set().description.uncertainty;
  for (int i = 0; i < kDeviations; ++i) {
    const double deviation = DeviationAt(uncertainty, i);
    if (deviation > 0) deviations_.push_back({i, deviation});
  }
  shift_uncertainty_px_ = uncertainty.line_position_each_px;
  if (shift_uncertainty_px_ > 0) shifts_ = static_cast<int>(model.position_ids().size());
}

Eigen::VectorXd ParameterVector::PriorWeights(const Eigen::VectorXd& x) const {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(size());
  for (int i = first_effect(); i < size(); ++i) weights[i] = FitPriorWeight(x[i]);
  return weights;
}

double ParameterVector::Penalty(const Eigen::VectorXd& x) const {
  double sum = x.head(first_effect()).squaredNorm();
  for (int i = first_effect(); i < size(); ++i) sum += FitPenalty(x[i]);
  return sum;
}

Eigen::VectorXd ParameterVector::FromParameters(SetParameters parameters) const {
  Eigen::VectorXd x(size());
  int i = 0;
  for (const auto& [index, uncertainty] : deviations_) {
    x[i++] = DeviationAt(parameters.deviations, index) / uncertainty;
  }
  for (int s = 0; s < shifts_; ++s) {
    x[i++] = parameters.line_shift_px[model_.position_ids()[s]] / shift_uncertainty_px_;
  }
  for (double error : parameters.model_error.standardised) x[i++] = error;
  for (size_t k = 0; k < free_.size(); ++k) {
    x[i++] = StandardisedParameter(
        Parameter(k), parameters.effects[free_[k].effect].parameters[free_[k].parameter]);
  }
  return x;
}

SetParameters ParameterVector::ToParameters(const Eigen::VectorXd& x) const {
  SetParameters parameters = start_;
  int i = 0;
  for (const auto& [index, uncertainty] : deviations_) {
    DeviationAt(parameters.deviations, index) = x[i++] * uncertainty;
  }
  for (int s = 0; s < shifts_; ++s) {
    parameters.line_shift_px[model_.position_ids()[s]] = x[i++] * shift_uncertainty_px_;
  }
  for (double& error : parameters.model_error.standardised) error = x[i++];
  for (size_t k = 0; k < free_.size(); ++k) {
    parameters.effects[free_[k].effect].parameters[free_[k].parameter] =
        ParameterFromStandardised(Parameter(k), x[i++]);
  }
  return parameters;
}

Eigen::VectorXd ParameterVector::Bounded(const Eigen::VectorXd& x) const {
  Eigen::VectorXd bounded = FromParameters(ToParameters(x));
  auto deviations = bounded.head(first_effect()).array();
  deviations = deviations.max(-kLargestDeviation).min(kLargestDeviation);
  return bounded;
}

SetParameters AtStandardised(const SetModel& model, const SetParameters& from,
                             const Eigen::VectorXd& standardised) {
  const ParameterVector vector(model, from, {});
  return vector.ToParameters(vector.Bounded(standardised.head(vector.size())));
}

}  // namespace sightline
