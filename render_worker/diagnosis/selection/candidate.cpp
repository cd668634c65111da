// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/candidate.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/free_form/free_form.h"
#include "render_worker/diagnosis/random_effect/recording_scatter.h"
#include "render_worker/diagnosis/selection/term_selection.h"

namespace sightline {

namespace {

// Prior odds. Three in ten sets are believed to be as described, since who asks has mostly seen
// something; one in ten of the others to follow a law that is not in the vocabulary; one in ten to
// have one more effect.
constexpr double kNone = 0.3;
// Of those, half to follow one that is near a known one.
constexpr double kNearKnown = 0.5;
constexpr double kStages = 6;  // that share the free-form terms
constexpr double kOneMore = 0.1;
constexpr double kKnownToBeThere = 2;  // standard errors

// Of the strengths, and of which coefficients a free-form term needs.
double LogPrior(const Candidate& candidate) {
  double sum = 0;
  for (size_t e = 0; e < candidate.effects.size(); ++e) {
    const ActiveEffect& active = candidate.effects[e];
    for (const EffectParameter& parameter : active.effect->description().parameters) {
      const std::vector<double> tried = WholeNumbers(parameter);
      if (!tried.empty()) sum -= std::log(static_cast<double>(tried.size()));
    }
    if (!IsFreeForm(*active.effect)) continue;
    const auto fitted =
        std::count_if(candidate.free.begin(), candidate.free.end(),
                      [&](const auto& free) { return free.effect == static_cast<int>(e); });
    sum += LogSelectionPrior(static_cast<int>(fitted),
                             static_cast<int>(active.effect->description().parameters.size()));
  }
  assert(candidate.fit.effect_standard_errors.size() == candidate.free.size());
  for (size_t f = 0; f < candidate.free.size(); ++f) {
    const FreeEffectParameter& free = candidate.free[f];
    const ActiveEffect& active = candidate.effects[free.effect];
    const EffectParameter& parameter = active.effect->description().parameters[free.parameter];
    sum += LogParameterPrior(parameter,
                             StandardisedParameter(parameter, active.parameters[free.parameter]),
                             candidate.fit.effect_standard_errors[f] / parameter.prior_scale);
  }
  return sum;
}

// Of the information of all parameters, those of effects last.
double LogDeterminantAbout(const FitResult& fit, const FitResult& about) {
  const auto effects = static_cast<Eigen::Index>(fit.free.size());
  const Eigen::Index known = fit.standardised.size() - effects;
  Eigen::MatrixXd information = fit.prior_weight.asDiagonal();
  for (size_t e = 0; e < fit.jacobian.size(); ++e) {
    Eigen::MatrixXd jacobian = fit.jacobian[e];
    jacobian.leftCols(known) = about.jacobian[e].leftCols(known);
    information.noalias() += jacobian.transpose() * jacobian;
  }
  return 2 * information.llt().matrixLLT().diagonal().array().log().sum();
}

// Evidence, less what errors of the model and of the best effect's modelled change may be worth:
// these can look like another effect in its place. One more effect, which changes something else,
// counts in full once it gains more than such errors could.
std::vector<double> TrustedEvidence(const std::vector<Candidate>& candidates) {
  double best = 0, single = 0, effect_error = kEffectError;
  for (const Candidate& candidate : candidates) {
    best = std::max(best, candidate.log_evidence);
    if (candidate.effects.size() != 1 || candidate.log_evidence < single) continue;
    single = candidate.log_evidence;
    // What has been followed through the recordings makes the changes that they show.
    effect_error = candidate.phases_rad.empty() ? kEffectError : 0;
  }
  const double weight = kEvidenceWeight / (1 + effect_error * effect_error * best);
  const double error = 2 * effect_error * effect_error * single;
  std::vector<double> trusted;
  for (const Candidate& candidate : candidates) {
    trusted.push_back(weight * candidate.log_evidence);
    if (candidate.effects.size() < 2 || IsFreeForm(candidate)) continue;
    const FitResult& fit = candidate.fit;
    const double misfit = std::max(1.0, fit.chi_squared / std::max(1, fit.data_count));
    const double more = candidate.log_evidence - single - error;
    trusted.back() = std::max(trusted.back(), weight * single + kEvidenceWeight / misfit * more);
  }
  return trusted;
}

}  // namespace

Candidate MakeCandidate(std::vector<ActiveEffect> effects) {
  Candidate candidate;
  std::stable_sort(effects.begin(), effects.end(), [](const auto& a, const auto& b) {
    return a.effect->description().id < b.effect->description().id;
  });
  candidate.effects = std::move(effects);
  // In the order in which they act; terms of unknown physics are alone.
  if (candidate.effects.size() > 1) {
    const absl::Status ordered = OrderEffects(&candidate.effects);
    (void)ordered;
  }
  candidate.free = FreeParameters(candidate.effects);
  return candidate;
}

bool IsFreeForm(const Effect& effect) {
  return FindFreeFormTerm(effect.description().id) != nullptr;
}

bool IsFreeForm(const Candidate& candidate) {
  return std::any_of(candidate.effects.begin(), candidate.effects.end(),
                     [](const ActiveEffect& active) { return IsFreeForm(*active.effect); });
}

bool IsScatter(const Candidate& candidate) {
  return !candidate.effects.empty() && IsRecordingScatter(*candidate.effects[0].effect);
}

bool EffectsAreThere(const Candidate& candidate) {
  if (candidate.effects.size() < 2 || IsFreeForm(candidate)) return true;
  std::vector<bool> fitted(candidate.effects.size()), there(candidate.effects.size());
  for (size_t f = 0; f < candidate.free.size(); ++f) {
    const auto [effect, parameter] = candidate.free[f];
    const ActiveEffect& active = candidate.effects[effect];
    const double from_null = active.parameters[parameter] -
                             active.effect->description().parameters[parameter].null_value;
    fitted[effect] = true;
    if (std::abs(from_null) > kKnownToBeThere * candidate.fit.effect_standard_errors[f]) {
      there[effect] = true;
    }
  }
  for (size_t e = 0; e < fitted.size(); ++e) {
    if (fitted[e] && !there[e]) return false;
  }
  return true;
}

double LogEvidence(const Candidate& candidate, const FitResult& null) {
  return -0.5 * (TwiceCost(candidate.fit) - TwiceCost(null)) + LogPrior(candidate);
}

double LogEvidence(const Candidate& candidate, const FitResult& null, const FitResult& about) {
  const FitResult& fit = candidate.fit;
  const double more = LogDeterminantAbout(fit, about) - LogDeterminantAbout(null, about);
  return LogEvidence(candidate, null) + 0.5 * (fit.log_determinant - null.log_determinant - more);
}

void RankCandidates(const CandidateCounts& counts, std::vector<Candidate>* candidates) {
  assert(!candidates->empty());
  const std::vector<double> trusted_evidence = TrustedEvidence(*candidates);
  const double effects = counts.effects;
  const double forms = std::max(1, counts.free_forms);
  double largest = -1e300;
  for (size_t c = 0; c < candidates->size(); ++c) {
    Candidate& candidate = (*candidates)[c];
    if (candidate.effects.empty()) {
      candidate.log_prior = std::log(kNone);
    } else if (IsFreeForm(candidate)) {
      const bool near_known = candidate.effects.size() > 1;
      candidate.log_prior =
          std::log((1 - kNone) * kUnknownPrior *
                   (near_known ? kNearKnown * kStages / effects : 1 - kNearKnown) / forms);
    } else {
      candidate.log_prior =
          std::log((1 - kNone) * (1 - kUnknownPrior) / effects) +
          (static_cast<double>(candidate.effects.size()) - 1) * std::log(kOneMore / effects);
    }
    candidate.probability = trusted_evidence[c] + candidate.log_prior;
    largest = std::max(largest, candidate.probability);
  }
  double sum = 0;
  for (Candidate& candidate : *candidates) {
    candidate.probability = std::exp(candidate.probability - largest);
    sum += candidate.probability;
  }
  for (Candidate& candidate : *candidates) candidate.probability /= sum;
  std::stable_sort(
      candidates->begin(), candidates->end(),
      [](const Candidate& a, const Candidate& b) { return a.probability > b.probability; });
}

}  // namespace sightline
