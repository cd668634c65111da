// Which effects, singly and together, explain a set best.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "render_worker/diagnosis/fit.h"

namespace sightline {

// The change an effect makes is modelled to about this part of it. Where it is thousands of
// standard deviations, that part is many, which explanations must not be told apart by.
constexpr double kEffectError = 0.02;

struct Candidate {
  std::vector<ActiveEffect> effects;  // with fitted strengths; none: the null model
  std::vector<FreeEffectParameter> free;
  FitResult fit;
  // Logarithm of the evidence by Laplace's approximation, over that of the null model [nats]; the
  // whole set under one covariance.
  double log_evidence = 0;
  double log_prior = 0;
  double probability = 0;
};

// What single effects can do, from the null model linearised.
struct ScreenedEffect {
  ActiveEffect strongest;  // where the recordings fit best, about; any, if they do not
  Eigen::VectorXd change;  // there, whitened
  double gain = 0;         // in log-likelihood [nats]
  // If everything were linear. Much more than `gain`: the null model's deviations have taken the
  // effect's place, and both must move together.
  double linear_gain = 0;
  ActiveEffect linear_best;
  // Standardised strength of its first parameter that has one, at which the expected gain is 5.
  int parameter = 0;
  double detectable = 0;  // 0: the recordings do not show it
};

struct Competition {
  FitResult null;                 // under the covariance of all candidates
  std::vector<Candidate> ranked;  // most probable first; the null model among them
  std::vector<ScreenedEffect> screened;
  // Effects whose change no fitted parameter can tell from that of ranked.front()'s first effect:
  // squared cosine above 0.98.
  std::vector<const Effect*> same_class;
};

struct CompetitionSettings {
  std::span<const Effect* const> effects;     // to consider, of the vocabulary
  std::span<const Effect* const> free_forms;  // terms of unknown physics, singly only
  int max_effects = 2;
};

// Every effect starts from a few strengths and shapes on the null model; the most promising are
// fitted together with all known parameters, then again under the covariance of the best. False
// from `progress` (fraction done): stops, with what there is.
Competition Compete(const SetModel& model, const FitResult& null,
                    const CompetitionSettings& settings,
                    const std::function<bool(double)>& progress);

}  // namespace sightline
