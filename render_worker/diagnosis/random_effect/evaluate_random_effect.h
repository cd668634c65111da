// SPDX-License-Identifier: Apache-2.0
// Evidence and realisation of one random effect, given a fit to linearise about.
//
// Linearise the set, search the parameters with the largest marginal likelihood, take the most
// probable amplitudes given these, and linearise again there. The full model, evaluated at the
// realisation found, decides which of the rounds is best.
#pragma once

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/random_effect/law/random_effect.h"
#include "render_worker/diagnosis/random_effect/linearised_set.h"
#include "render_worker/diagnosis/random_effect/realisation.h"

namespace sightline {

struct EvaluatedRandomEffect {
  RandomEffectCandidate candidate;
  Realisation realisation;  // most probable
};

// `law`: that of `effect`. `start`: the first linearisation point.
EvaluatedRandomEffect EvaluateRandomEffect(const LinearisationBasis& basis, const Effect& effect,
                                           const RandomEffect& law, const Realisation& start);

}  // namespace sightline
