// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "render_worker/diagnosis/expectation/expected_light.h"
#include "render_worker/diagnosis/selection/flicker_search.h"
#include "render_worker/diagnosis/selection/fringe_search.h"

namespace sightline {

namespace {

// Strengths beyond so many scales of their priors are not looked for.
constexpr double kFarthest = 100;
constexpr double kLeastLinearGain = 0.75;  // [nats] of a straight line, worth a look
constexpr double kProbe = 0.5;             // standardised
constexpr double kLinearLength = 25;       // of a change, squared and whitened: it is linear so far
constexpr double kStraight = 0.5;          // of a straight line's gain, reached where it is one
constexpr double kMiddleError = 0.02;      // of a change taken to be alike along the line

// Of one effect: what has been found so far, and what is tried next.
class Search {
 public:
  Search(const Screening& screening, const Effect& effect)
      : screening_(screening),
        linear_(screening.linear()),
        parameters_(effect.description().parameters),
        null_(AtNullValues(effect)) {
    best_.strongest = null_;
  }

  // `seen`: where the recordings themselves show it.
  ScreenedEffect Run(const std::vector<ActiveEffect>& seen) {
    for (const ActiveEffect& active : seen) Try(active, false);
    if (parameters_.size() == 1 && !WholeNumbers(parameters_[0]).empty()) {
      for (double value : WholeNumbers(parameters_[0])) Try({null_.effect, {value}}, false);
      return best_;
    }
    // Parameters that change nothing by themselves only shape what others do.
    std::vector<size_t> strengths, shapes;
    std::vector<Eigen::VectorXd> slopes, near_slopes;  // near: by steps small enough to be linear
    bool middle_only = true;  // alike along the line, in all that has been looked at
    for (size_t k = 0; k < parameters_.size(); ++k) {
      ActiveEffect probe = null_;
      const double sign = parameters_[k].null_value < parameters_[k].upper ? 1 : -1;
      probe.parameters[k] = ParameterFromStandardised(parameters_[k], sign * kProbe);
      const double step = StandardisedParameter(parameters_[k], probe.parameters[k]);
      Eigen::VectorXd change = screening_.ChangeOf(probe);
      if (change.squaredNorm() > 1e-12) {
        if (Gain(change) > best_.gain || best_.change.size() == 0) {
          best_.strongest = probe;
          best_.change = change;
          best_.gain = Gain(change);
        }
        if (strengths.empty()) {
          best_.parameter = static_cast<int>(k);
          best_.detectable = Detectable(k, step, linear_.Inner(change, change));
        }
        const Eigen::VectorXd error = change - screening_.ChangeOf(probe, true);
        middle_only = middle_only && error.norm() < kMiddleError * change.norm();
        strengths.push_back(k);
        slopes.push_back(change / step);
        near_slopes.push_back(slopes.back());
        const double length = linear_.Inner(change, change);
        if (length > kLinearLength) {
          const double near = step * std::sqrt(kLinearLength / length);
          probe.parameters[k] = ParameterFromStandardised(parameters_[k], near);
          near_slopes.back() = screening_.ChangeOf(probe, middle_only) / near;
        }
      } else {
        shapes.push_back(k);
      }
    }
    // Nothing by itself: beyond a threshold only, or a strength with another parameter far off.
    const bool hidden = strengths.empty();
    if (hidden) {
      middle_only = false;  // nothing has been looked at
      for (size_t k : shapes) TryBeyondThreshold(k);
      if (best_.gain > 0 || parameters_.size() < 2) return best_;
      strengths = {0};
      slopes.resize(1);
      shapes.erase(shapes.begin());
    } else {
      TrySlopes(null_, strengths, slopes, middle_only);
      TrySlopes(null_, strengths, near_slopes, middle_only);
    }
    for (const ActiveEffect& shaped : OtherShapes(shapes, hidden)) {
      for (size_t s = 0; s < strengths.size(); ++s) {
        ActiveEffect probe = shaped;
        const EffectParameter& strength = parameters_[strengths[s]];
        probe.parameters[strengths[s]] = ParameterFromStandardised(strength, kProbe);
        slopes[s] = screening_.ChangeOf(probe, middle_only) /
                    StandardisedParameter(strength, probe.parameters[strengths[s]]);
      }
      TrySlopes(shaped, strengths, slopes, middle_only);
    }
    // Far from linear (defocus acts alike in both directions near the focus): larger steps either
    // way, and on in the same direction for as long as they help.
    if (strengths.size() == 1) {
      const EffectParameter& strength = parameters_[strengths[0]];
      const auto try_at = [&](double z) {
        ActiveEffect far = null_;
        far.parameters[strengths[0]] = ParameterFromStandardised(strength, z);
        return far.parameters[strengths[0]] != strength.null_value
                   ? Try(far, middle_only)
                   : -std::numeric_limits<double>::infinity();
      };
      for (const double direction : {-1.0, 1.0}) {
        double last = try_at(direction);
        double gain = try_at(3 * direction);
        for (double z = 6 * direction;
             gain > last && gain > 0 && std::abs(z) <= kFarthest && IsInside(strength, z); z *= 2) {
          last = gain;
          gain = try_at(z);
        }
      }
      if (best_.gain < kStraight * best_.linear_gain) TryBetween(strengths[0], middle_only);
    }
    return best_;
  }

 private:
  double Gain(const Eigen::VectorXd& change) const {
    return linear_.residual().dot(change) - 0.5 * linear_.Inner(change, change);
  }

  static bool IsInside(const EffectParameter& parameter, double standardised) {
    const double value = ParameterFromStandardised(parameter, standardised);
    return value > parameter.lower && value < parameter.upper;
  }

  // Returns the gain.
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

  // Standardised strength of parameter `k` at which the expected gain is 5, from that at `step`,
  // half of `length`: by the power law through the last two strengths looked at. Variances grow
  // with the square of a strength, and what is far from linear may follow any law.
  double Detectable(size_t k, double step, double length) const {
    constexpr double kDetectable = 10;
    constexpr int kTrials = 4;
    if (!(length > 1e-9)) return 0;
    double z = step * std::sqrt(kDetectable / length);
    for (int trial = 0; trial < kTrials && std::abs(std::log(length / kDetectable)) > 0.2;
         ++trial) {
      ActiveEffect probe = null_;
      probe.parameters[k] = ParameterFromStandardised(parameters_[k], z);
      const Eigen::VectorXd change = screening_.ChangeOf(probe);
      const double here = linear_.Inner(change, change);
      if (!(here > 1e-9)) break;
      const double power =
          z != step ? std::clamp(std::log(here / length) / std::log(z / step), 0.5, 6.0) : 2;
      step = z;
      length = here;
      z *= std::pow(kDetectable / here, 1 / power);
    }
    return std::abs(z);
  }

  // Besides the null values: all combinations of the values that descriptions say to start from;
  // of other shapes one at a time, either way.
  std::vector<ActiveEffect> OtherShapes(const std::vector<size_t>& shapes, bool hidden) const {
    std::vector<ActiveEffect> tried = {null_};
    for (size_t shape : shapes) {
      const size_t before = tried.size();
      for (double value : parameters_[shape].starts) {
        for (size_t i = 0; i < before; ++i) {
          tried.push_back(tried[i]);
          tried.back().parameters[shape] = value;
        }
      }
    }
    tried.erase(tried.begin());
    const std::vector<double> offsets =
        hidden ? std::vector<double>{-4.5, -3, -1.5, 1.5} : std::vector<double>{-1.5, 1.5};
    for (size_t shape : shapes) {
      if (!parameters_[shape].starts.empty()) continue;
      for (double z : offsets) {
        ActiveEffect shaped = null_;
        shaped.parameters[shape] = ParameterFromStandardised(parameters_[shape], z);
        if (shaped.parameters[shape] != null_.parameters[shape]) tried.push_back(shaped);
      }
    }
    return tried;
  }

  // What grows with the square of its strength (the variance of speckle that moves) lies beyond
  // where a straight line is one, and far below where that line leads.
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
  // values beyond the one from which on it does, alone and with the others changed. These may move
  // the threshold itself: a rim that is shifted cuts the pupil sooner.
  void TryBeyondThreshold(size_t k) {
    const double threshold = ThresholdOf(null_, k);
    if (threshold == 0) return;
    TryBeyond(null_, k, threshold);
    for (size_t j = 0; j < parameters_.size(); ++j) {
      if (j == k) continue;
      for (const double z : {-1.5, 1.5}) {
        ActiveEffect shaped = null_;
        shaped.parameters[j] = ParameterFromStandardised(parameters_[j], z);
        TryBeyond(shaped, k, threshold);
        const double moved = ThresholdOf(shaped, k);
        if (moved > 1.01 * threshold) TryBeyond(shaped, k, moved);
      }
    }
  }

  void TryBeyond(const ActiveEffect& shaped, size_t k, double threshold) {
    for (const double ratio : {1.0, 0.97, 0.92, 0.85, 0.7, 0.5}) {
      ActiveEffect beyond = shaped;
      beyond.parameters[k] = std::max(parameters_[k].lower, ratio * threshold);
      Try(beyond, false);
    }
  }

  // Largest value of parameter `k` below its null value that changes anything, to a per cent; 0 if
  // none does.
  double ThresholdOf(const ActiveEffect& shaped, size_t k) const {
    const auto changes = [&](double value) {
      ActiveEffect active = shaped;
      active.parameters[k] = value;
      return !(screening_.ChangeOf(active).squaredNorm() <= 1e-12);  // no light at all: no number
    };
    double without = shaped.parameters[k];
    double with = parameters_[k].lower;
    if (!(with > 0 && with < without) || !changes(with)) return 0;
    while (without / with > 1.01) {
      const double middle = std::sqrt(without * with);
      (changes(middle) ? with : without) = middle;
    }
    return with;
  }

  // Standardised, and what they gain, if everything were linear.
  static std::pair<Eigen::VectorXd, double> BestStrengths(
      const LinearFit& linear, const Eigen::VectorXd& residual,
      const std::vector<Eigen::VectorXd>& slopes) {
    const auto n = static_cast<Eigen::Index>(slopes.size());
    Eigen::MatrixXd information = 0.01 * Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd gradient(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      gradient[i] = residual.dot(slopes[i]);
      for (Eigen::Index j = 0; j < n; ++j) information(i, j) += linear.Inner(slopes[i], slopes[j]);
    }
    Eigen::VectorXd z = information.llt().solve(gradient);
    const double gain = 0.5 * z.dot(gradient);
    return {std::move(z), gain};
  }

  // The best strengths if everything were linear, and half of that.
  void TrySlopes(const ActiveEffect& shaped, const std::vector<size_t>& strengths,
                 const std::vector<Eigen::VectorXd>& slopes, bool middle_only) {
    const auto at = [&](const Eigen::VectorXd& z) {
      ActiveEffect active = shaped;
      for (size_t i = 0; i < strengths.size(); ++i) {
        active.parameters[strengths[i]] = ParameterFromStandardised(
            parameters_[strengths[i]], std::clamp(z[static_cast<Eigen::Index>(i)], -8.0, 8.0));
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
    if (!(linear_gain >= kLeastLinearGain)) return;
    for (double part : {1.0, 0.4}) {
      const ActiveEffect active = at(part * z);
      if (!moves(active)) return;
      keep_linear(active, linear_gain);
      const double before = best_.gain;
      Try(active, middle_only);
      if (part == 1 && best_.gain > before && best_.gain > 0.6 * linear_gain) return;
    }
  }

  const Screening& screening_;
  const LinearFit& linear_;
  const std::vector<EffectParameter>& parameters_;
  const ActiveEffect null_;
  ScreenedEffect best_;
};

}  // namespace

ActiveEffect AtNullValues(const Effect& effect) {
  ActiveEffect active{&effect, {}};
  for (const EffectParameter& p : effect.description().parameters) {
    active.parameters.push_back(p.null_value);
  }
  return active;
}

Screening::Screening(const SetModel& model, const FitResult& base, std::vector<bool> use_entry)
    : model_(model),
      base_(base),
      linear_(base, use_entry),
      base_middle_(model.Expect(base.parameters, false, true).mean) {
  if (std::find(base.held.begin(), base.held.end(), true) == base.held.end()) return;
  released_.emplace(base, std::move(use_entry), LinearFit::Held::kFree);
  released_residual_ = released_->ResidualAtBest();
}

ScreenedEffect Screening::Screen(const Effect& effect) const {
  return Search(*this, effect).Run(Seen(effect));
}

// Waves lead nowhere from another wave's period.
std::vector<ActiveEffect> Screening::Seen(const Effect& effect) const {
  const std::string_view id = effect.description().id;
  if (id == kCoverGlassEtalon) return FringesSeen(model_.set());
  if (id != kAmbientFlicker) return {};
  ActiveEffect steady = AtNullValues(effect);
  steady.parameters[0] = ParameterFromStandardised(effect.description().parameters[0], kProbe);
  steady.parameters[1] = 0;
  // As little as makes it linear.
  Eigen::VectorXd change = ChangeOf(steady);
  for (int turn = 0; turn < 3 && change.squaredNorm() > 10 * kLinearLength; ++turn) {
    steady.parameters[0] *= std::sqrt(kLinearLength / change.squaredNorm());
    change = ChangeOf(steady);
  }
  return FlickerSeen(model_, base_, change, steady.parameters[0]);
}

Eigen::VectorXd Screening::ChangeOf(const ActiveEffect& active, bool middle_only) const {
  SetParameters parameters = base_.parameters;
  parameters.effects.push_back(active);
  Entries mean = model_.Expect(parameters, false, middle_only).mean;
  for (size_t e = 0; middle_only && e < mean.size(); ++e) {
    mean[e] += base_.mean[e] - base_middle_[e];
  }
  return linear_.Change(mean);
}

}  // namespace sightline
