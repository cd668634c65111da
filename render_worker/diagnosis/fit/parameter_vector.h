// SPDX-License-Identifier: Apache-2.0
// The vector of standardised parameters that a fit varies, and its translation to the parameters of
// a set's model.
#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// A parameter of an effect that is fitted; the effect's other parameters keep their values.
struct FreeEffectParameter {
  int effect = 0;     // index into SetParameters::effects
  int parameter = 0;  // index into its parameters
};

// All continuous parameters of the effects. Discrete ones (EffectParameter::discrete_values) are
// tried value by value instead.
std::vector<FreeEffectParameter> FreeParameters(const std::vector<ActiveEffect>& effects);

// Order of the vector: deviations of the set-up over their standard uncertainties (those with an
// uncertainty), the line shift of every plate position over its uncertainty, the model's errors,
// the effects' free parameters. Each has a standard normal prior; the last group has the prior of
// parameter_prior.h.
class ParameterVector {
 public:
  // `start` gives the values of everything that is not fitted. `model` must outlive the vector.
  ParameterVector(const SetModel& model, const SetParameters& start,
                  const std::vector<FreeEffectParameter>& free);

  int size() const { return first_effect() + static_cast<int>(free_.size()); }
  int first_shift() const { return static_cast<int>(deviations_.size()); }
  int first_model_error() const { return first_shift() + shifts_; }
  int first_effect() const { return first_model_error() + ModelError::kCount; }
  int shifts() const { return shifts_; }
  // Name of deviation i < first_shift(), as in the recordings format.
  std::string_view DeviationName(int i) const { return kDeviationNames[deviations_[i].index]; }
  // Description of free effect parameter k.
  const EffectParameter& Parameter(size_t k) const {
    return start_.effects[free_[k].effect].effect->description().parameters[free_[k].parameter];
  }

  // Diagonal of the prior's information matrix at x.
  Eigen::VectorXd PriorWeights(const Eigen::VectorXd& x) const;
  // Twice the negative logarithm of the prior density at x over that at 0.
  double Penalty(const Eigen::VectorXd& x) const;

  Eigen::VectorXd FromParameters(SetParameters parameters) const;
  SetParameters ToParameters(const Eigen::VectorXd& x) const;
  // x within the bounds: deviations, shifts and model errors within three standard uncertainties,
  // effects' parameters within their physical bounds.
  Eigen::VectorXd Bounded(const Eigen::VectorXd& x) const;

 private:
  struct Deviation {
    int index = 0;  // of DeviationAt
    double uncertainty = 0;
  };

  const SetModel& model_;
  SetParameters start_;
  std::vector<FreeEffectParameter> free_;
  std::vector<Deviation> deviations_;
  double shift_uncertainty_px_ = 0;
  int shifts_ = 0;
};

// `from` with the deviations, line shifts and model errors at the beginning of `standardised`,
// moved within their bounds.
SetParameters AtStandardised(const SetModel& model, const SetParameters& from,
                             const Eigen::VectorXd& standardised);

}  // namespace sightline
