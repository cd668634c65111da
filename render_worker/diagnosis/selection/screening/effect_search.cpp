// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening/effect_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

namespace {

using Parameters = std::vector<EffectParameter>;

bool IsInside(const EffectParameter& parameter, double standardised) {
  const double value = ParameterFromStandardised(parameter, standardised);
  return value > parameter.lower && value < parameter.upper;
}

// Standardised value of parameter `k` at which the expected gain is 5 nats, from its value `step`
// with a change of squared length `length`. A secant search in logarithms: the power law through
// the last two values leads to the next. Variances grow with the square of a strength, and effects
// far from linear may have any power.
double DetectableStrength(const Screening& screening, const ActiveEffect& null, size_t k,
                          double step, double length) {
  if (!(length > 1e-9)) return 0;
  double z = step * std::sqrt(thresholds::kDetectableLength / length);
  for (int trial = 0;
       trial < thresholds::kDetectableTrials &&
       std::abs(std::log(length / thresholds::kDetectableLength)) > thresholds::kDetectableLogError;
       ++trial) {
    ActiveEffect probe = null;
    probe.parameters[k] = ParameterFromStandardised(null.effect->description().parameters[k], z);
    const Eigen::VectorXd change = screening.ChangeOf(probe);
    const double here = screening.linear().Inner(change, change);
    if (!(here > 1e-9)) break;
    const double power =
        z != step ? std::clamp(std::log(here / length) / std::log(z / step), 0.5, 6.0) : 2;
    step = z;
    length = here;
    z *= std::pow(thresholds::kDetectableLength / here, 1 / power);
  }
  return std::abs(z);
}

// Shapes to try besides the null values: all combinations of the values that the description starts
// from, and shapes without such values one at a time, either way.
std::vector<ActiveEffect> OtherShapes(const ActiveEffect& null, const std::vector<size_t>& shapes,
                                      bool hidden) {
  const Parameters& parameters = null.effect->description().parameters;
  std::vector<ActiveEffect> tried = {null};
  for (size_t shape : shapes) {
    const size_t before = tried.size();
    for (double value : parameters[shape].starts) {
      for (size_t i = 0; i < before; ++i) {
        tried.push_back(tried[i]);
        tried.back().parameters[shape] = value;
      }
    }
  }
  tried.erase(tried.begin());
  const std::span<const double> offsets =
      hidden ? std::span<const double>(thresholds::kHiddenShapes) : thresholds::kShapes;
  for (size_t shape : shapes) {
    if (!parameters[shape].starts.empty()) continue;
    for (double z : offsets) {
      ActiveEffect shaped = null;
      shaped.parameters[shape] = ParameterFromStandardised(parameters[shape], z);
      if (shaped.parameters[shape] != null.parameters[shape]) tried.push_back(shaped);
    }
  }
  return tried;
}

// Largest value of parameter `k` below its null value that changes anything, bracketed to
// kThresholdWidth; 0 if no value does.
double ThresholdOf(const Screening& screening, const ActiveEffect& shaped, size_t k) {
  const auto changes = [&](double value) {
    ActiveEffect active = shaped;
    active.parameters[k] = value;
    // Without any light the change is not a number.
    return !(screening.ChangeOf(active).squaredNorm() <= thresholds::kNoChange);
  };
  double without = shaped.parameters[k];
  double with = shaped.effect->description().parameters[k].lower;
  if (!(with > 0 && with < without) || !changes(with)) return 0;
  while (without / with > thresholds::kThresholdWidth) {
    const double middle = std::sqrt(without * with);
    (changes(middle) ? with : without) = middle;
  }
  return with;
}

// Standardised strengths of largest gain, and that gain, if the model were linear: (A + c I)^-1 g
// with gradient g and information A.
std::pair<Eigen::VectorXd, double> BestStrengths(const LinearFit& linear,
                                                 const Eigen::VectorXd& residual,
                                                 const std::vector<Eigen::VectorXd>& slopes) {
  const auto n = static_cast<Eigen::Index>(slopes.size());
  Eigen::MatrixXd information = thresholds::kStrengthInformation * Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd gradient(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    gradient[i] = residual.dot(slopes[i]);
    for (Eigen::Index j = 0; j < n; ++j) information(i, j) += linear.Inner(slopes[i], slopes[j]);
  }
  Eigen::VectorXd z = information.llt().solve(gradient);
  const double gain = 0.5 * z.dot(gradient);
  return {std::move(z), gain};
}

// Parameters of one effect by what a step from the null values does. Shapes change nothing by
// themselves, only what strengths do.
struct ProbedParameters {
  std::vector<size_t> strengths, shapes;
  // Derivatives with respect to the standardised strengths, by the first step and by steps small
  // enough to be linear.
  std::vector<Eigen::VectorXd> slopes, near_slopes;
  bool middle_only = true;  // the middle of the line stands for all of it
};

// Keeps the best parameters of one effect that have been evaluated.
class EffectSearch {
 public:
  EffectSearch(const Screening& screening, const Effect& effect)
      : screening_(screening),
        linear_(screening.linear()),
        parameters_(effect.description().parameters),
        null_(AtNullValues(effect)) {
    best_.strongest = null_;
  }

  ScreenedEffect Run(const std::vector<ActiveEffect>& starts) {
    for (const ActiveEffect& active : starts) Try(active, false);
    if (parameters_.size() == 1 && !parameters_[0].discrete_values.empty()) {
      for (double value : parameters_[0].discrete_values) Try({null_.effect, {value}}, false);
      return best_;
    }
    ProbedParameters probed = Probe();
    // Nothing changes by itself: the effect begins beyond a threshold only, or a strength acts with
    // another parameter far from its null value.
    const bool hidden = probed.strengths.empty();
    if (hidden) {
      probed.middle_only = false;  // nothing has been looked at
      for (size_t k : probed.shapes) TryBeyondThreshold(k);
      if (best_.gain > 0 || parameters_.size() < 2) return best_;
      probed.strengths = {0};
      probed.slopes.resize(1);
      probed.shapes.erase(probed.shapes.begin());
    } else {
      TrySlopes(null_, probed.strengths, probed.slopes, probed.middle_only);
      TrySlopes(null_, probed.strengths, probed.near_slopes, probed.middle_only);
    }
    TryShapes(OtherShapes(null_, probed.shapes, hidden), probed);
    if (probed.strengths.size() == 1) {
      TryFar(probed.strengths[0], probed.middle_only);
      if (best_.gain < thresholds::kStraight * best_.linear_gain) {
        TryBetween(probed.strengths[0], probed.middle_only);
      }
    }
    return best_;
  }

 private:
  double Gain(const Eigen::VectorXd& change) const {
    return linear_.residual().dot(change) - 0.5 * linear_.Inner(change, change);
  }

  // Evaluates one set of parameters and returns its gain.
  double Try(const ActiveEffect& active, bool middle_only) {
    Eigen::VectorXd change = screening_.ChangeOf(active, middle_only);
    const double gain = Gain(change);
    if (gain > best_.gain || best_.change.size() == 0) {
      best_.strongest = active;
      best_.change = std::move(change);
      best_.gain = gain;
    }
    return gain;
  }

  // Steps every parameter by itself.
  ProbedParameters Probe() {
    ProbedParameters probed;
    for (size_t k = 0; k < parameters_.size(); ++k) {
      ActiveEffect probe = null_;
      const double sign = parameters_[k].null_value < parameters_[k].upper ? 1 : -1;
      probe.parameters[k] = ParameterFromStandardised(parameters_[k], sign * thresholds::kProbe);
      const double step = StandardisedParameter(parameters_[k], probe.parameters[k]);
      Eigen::VectorXd change = screening_.ChangeOf(probe);
      if (!(change.squaredNorm() > thresholds::kNoChange)) {
        probed.shapes.push_back(k);
        continue;
      }
      if (Gain(change) > best_.gain || best_.change.size() == 0) {
        best_.strongest = probe;
        best_.change = change;
        best_.gain = Gain(change);
      }
      if (probed.strengths.empty()) {
        best_.parameter = static_cast<int>(k);
        best_.detectable =
            DetectableStrength(screening_, null_, k, step, linear_.Inner(change, change));
      }
      const Eigen::VectorXd error = change - screening_.ChangeOf(probe, true);
      probed.middle_only =
          probed.middle_only && error.norm() < thresholds::kMiddleError * change.norm();
      probed.strengths.push_back(k);
      probed.slopes.push_back(change / step);
      probed.near_slopes.push_back(probed.slopes.back());
      const double length = linear_.Inner(change, change);
      if (length > thresholds::kLinearLength) {
        const double near = step * std::sqrt(thresholds::kLinearLength / length);
        probe.parameters[k] = ParameterFromStandardised(parameters_[k], near);
        probed.near_slopes.back() = screening_.ChangeOf(probe, probed.middle_only) / near;
      }
    }
    return probed;
  }

  // The best strengths with each of `shapes`.
  void TryShapes(const std::vector<ActiveEffect>& shapes, ProbedParameters& probed) {
    for (const ActiveEffect& shaped : shapes) {
      for (size_t s = 0; s < probed.strengths.size(); ++s) {
        ActiveEffect probe = shaped;
        const EffectParameter& strength = parameters_[probed.strengths[s]];
        probe.parameters[probed.strengths[s]] =
            ParameterFromStandardised(strength, thresholds::kProbe);
        probed.slopes[s] = screening_.ChangeOf(probe, probed.middle_only) /
                           StandardisedParameter(strength, probe.parameters[probed.strengths[s]]);
      }
      TrySlopes(shaped, probed.strengths, probed.slopes, probed.middle_only);
    }
  }

  // Larger steps of the only strength either way, doubled for as long as they gain more: some
  // effects are far from linear (defocus near the focus is alike in both directions).
  void TryFar(size_t k, bool middle_only) {
    const EffectParameter& strength = parameters_[k];
    const auto try_at = [&](double z) {
      ActiveEffect far = null_;
      far.parameters[k] = ParameterFromStandardised(strength, z);
      return far.parameters[k] != strength.null_value ? Try(far, middle_only)
                                                      : -std::numeric_limits<double>::infinity();
    };
    for (const double direction : {-1.0, 1.0}) {
      double last = try_at(direction);
      double gain = try_at(3 * direction);
      for (double z = 6 * direction;
           gain > last && gain > 0 && std::abs(z) <= thresholds::kFarthest && IsInside(strength, z);
           z *= 2) {
        last = gain;
        gain = try_at(z);
      }
    }
  }

  // Strengths between the small steps that are linear and the large ones. An effect that grows with
  // the square of its strength (the variance of speckle that moves) is strongest there.
  void TryBetween(size_t k, bool middle_only) {
    const double first = StandardisedParameter(parameters_[k], best_.strongest.parameters[k]);
    for (double z = 2 * first; z != 0 && std::abs(z) < 3; z *= 2) {
      ActiveEffect active = null_;
      active.parameters[k] = ParameterFromStandardised(parameters_[k], z);
      const double before = best_.gain;
      Try(active, middle_only);
      if (best_.gain == before) break;
    }
  }

  // A parameter that changes nothing until it is far from its null value (a full well, a rim):
  // values beyond the threshold, alone and with each other parameter changed. That may move the
  // threshold itself: a rim that is shifted cuts the pupil sooner.
  void TryBeyondThreshold(size_t k) {
    const double threshold = ThresholdOf(screening_, null_, k);
    if (threshold == 0) return;
    TryBeyond(null_, k, threshold);
    for (size_t j = 0; j < parameters_.size(); ++j) {
      if (j == k) continue;
      for (const double z : thresholds::kShapes) {
        ActiveEffect shaped = null_;
        shaped.parameters[j] = ParameterFromStandardised(parameters_[j], z);
        TryBeyond(shaped, k, threshold);
        const double moved = ThresholdOf(screening_, shaped, k);
        if (moved > thresholds::kThresholdWidth * threshold) TryBeyond(shaped, k, moved);
      }
    }
  }

  void TryBeyond(const ActiveEffect& shaped, size_t k, double threshold) {
    for (const double ratio : thresholds::kBeyondThreshold) {
      ActiveEffect beyond = shaped;
      beyond.parameters[k] = std::max(parameters_[k].lower, ratio * threshold);
      Try(beyond, false);
    }
  }

  // The best strengths if the model were linear, and a part of them.
  void TrySlopes(const ActiveEffect& shaped, const std::vector<size_t>& strengths,
                 const std::vector<Eigen::VectorXd>& slopes, bool middle_only) {
    const auto at = [&](const Eigen::VectorXd& z) {
      ActiveEffect active = shaped;
      for (size_t i = 0; i < strengths.size(); ++i) {
        active.parameters[strengths[i]] = ParameterFromStandardised(
            parameters_[strengths[i]],
            std::clamp(z[static_cast<Eigen::Index>(i)], -thresholds::kLargestStep,
                       thresholds::kLargestStep));
      }
      return active;
    };
    const auto moves = [&](const ActiveEffect& active) {
      return std::any_of(strengths.begin(), strengths.end(), [&](size_t k) {
        return active.parameters[k] != parameters_[k].null_value;
      });
    };
    const auto keep_linear = [&](const ActiveEffect& active, double gain) {
      if (!(gain > best_.linear_gain) || !moves(active)) return;
      best_.linear_gain = gain;
      best_.linear_best = active;
    };
    if (const LinearFit* released = screening_.released()) {
      const auto [z, gain] = BestStrengths(*released, screening_.released_residual(), slopes);
      keep_linear(at(z), gain);
    }
    const auto [z, linear_gain] = BestStrengths(linear_, linear_.residual(), slopes);
    if (!(linear_gain >= thresholds::kLeastLinearGain_nats)) return;
    for (double part : thresholds::kStepParts) {
      const ActiveEffect active = at(part * z);
      if (!moves(active)) return;
      keep_linear(active, linear_gain);
      const double before = best_.gain;
      Try(active, middle_only);
      if (part == 1 && best_.gain > before && best_.gain > thresholds::kStepReached * linear_gain) {
        return;
      }
    }
  }

  const Screening& screening_;
  const LinearFit& linear_;
  const Parameters& parameters_;
  const ActiveEffect null_;
  ScreenedEffect best_;
};

}  // namespace

ScreenedEffect SearchEffect(const Screening& screening, const Effect& effect,
                            const std::vector<ActiveEffect>& starts) {
  return EffectSearch(screening, effect).Run(starts);
}

}  // namespace sightline
