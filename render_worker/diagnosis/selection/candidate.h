// SPDX-License-Identifier: Apache-2.0
// An explanation of a set, its evidence, and how probable it is among others.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// Prior probability that what a set shows follows a law that is not in the vocabulary.
constexpr double kUnknownPrior = 0.1;

struct Candidate {
  std::vector<ActiveEffect> effects;  // with fitted strengths; none: the null model
  std::vector<FreeEffectParameter> free;
  FitResult fit;
  // What random effects are said to have drawn in every recording (light or movement); or empty.
  std::vector<double> drawn;
  std::vector<double> phases_rad;  // of a vibration that has been followed through the recordings
  // Logarithm of the evidence by Laplace's approximation, over that of the null model [nats]; the
  // whole set under one covariance.
  double log_evidence = 0;
  double log_prior = 0;
  double probability = 0;
};

// All parameters that are fitted are free; effects in the order in which they act.
Candidate MakeCandidate(std::vector<ActiveEffect> effects);

// Of unknown physics: a term of it, or a named effect and such a term.
bool IsFreeForm(const Effect& effect);
bool IsFreeForm(const Candidate& candidate);
// Of what is drawn anew for every recording.
bool IsScatter(const Candidate& candidate);

// False if the strength of one of several effects is not known to differ from none by two standard
// errors: nothing would be said by naming it. Whole numbers have no error; one effect is compared
// with none by its evidence.
bool EffectsAreThere(const Candidate& candidate);

// By Laplace's approximation: misfit, log|Sigma| of the data, log|H| of the parameters and every
// prior, Cauchy's of the strengths among them, over the same of `null`. Each fit may have a
// covariance of its own, of the same data.
double LogEvidence(const Candidate& candidate, const FitResult& null);
// With the derivatives of `about`, under that covariance too, with respect to the known parameters:
// those that fits find themselves differ by their steps and places, by nats that tell nothing.
double LogEvidence(const Candidate& candidate, const FitResult& null, const FitResult& about);

// How many there are to choose from: priors are shared out among them.
struct CandidateCounts {
  int effects = 0;
  int free_forms = 0;
};

// Fills in `log_prior` and `probability`, most probable first. `candidates`: at least one, the null
// model among them.
void RankCandidates(const CandidateCounts& counts, std::vector<Candidate>* candidates);

}  // namespace sightline
