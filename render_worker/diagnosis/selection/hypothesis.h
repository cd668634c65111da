// SPDX-License-Identifier: Apache-2.0
// A hypothesis about a set: effects with fitted parameters, and its evidence. The evidence of a
// model M with data y is Laplace's approximation of p(y | M), the integral of likelihood times
// prior over all parameters (MacKay, Information Theory, Inference, and Learning Algorithms (2003),
// chapter 28).
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/evidence/evidence.h"

namespace sightline {

struct Hypothesis {
  std::vector<ActiveEffect> effects;  // with fitted parameters; empty: the null model
  std::vector<FreeEffectParameter> free;
  FitResult fit;
  // Realised value of a random effect in every recording: light relative to the mean, or movement
  // of the image [px]. Empty: there is no random effect.
  std::vector<double> realised;
  // Phase in the middle of every exposure of a vibration whose phases were fitted [rad], or empty.
  std::vector<double> phases_rad;
  // Terms of the evidence over those of the null model, of the whole set. For a random effect `fit`
  // is its log-likelihood ratio, amplitudes and nuisance parameters integrated out.
  Evidence evidence;
  double log_evidence = 0;  // evidence.LogMarginalLikelihood() [nats]
  double log_prior = 0;
  // Log predictive density of recordings left out [nats], up to a constant of the data.
  double held_out_score = 0;
  double probability = 0;  // posterior, in [0, 1]
};

// Effects in the order in which they act; every parameter that can be fitted is free. Several
// effects must differ from each other and be of the vocabulary.
Hypothesis MakeHypothesis(std::vector<ActiveEffect> effects);

// True if one of the hypothesis' effects is `effect`.
bool Has(const Hypothesis& hypothesis, const Effect* effect);

// True for a model-discrepancy term, or a hypothesis that contains one.
bool IsFreeForm(const Effect& effect);
bool IsFreeForm(const Hypothesis& hypothesis);
// True for a random effect per recording or place by itself, or acting before all others.
bool IsRandomEffect(const Hypothesis& hypothesis);

// False if one of several effects has no parameter that differs from its null value by two standard
// errors, since that effect is not detected. Discrete parameters have no error; the evidence
// compares a single effect with none.
bool EffectsAreDetected(const Hypothesis& hypothesis);

// Terms of the evidence over those of the null model, without the model's prior:
//   -1/2 (X - X0) + log pi, X = chi squared + sum of z^2 + log |Sigma| + log |H|
// with the data's covariance Sigma, the set-up's standardised parameters z, the posterior
// information H, and the prior density pi of the effects' parameters. Each fit may have a
// covariance of its own, but both must be of the same data.
Evidence EvidenceOver(const Hypothesis& hypothesis, const FitResult& null);
// The same with the derivatives of `linearisation` with respect to the set-up's parameters in both
// information matrices; it must have the same covariance. Derivatives that every fit finds by its
// own finite differences change log |H| by some nats without meaning.
Evidence EvidenceOver(const Hypothesis& hypothesis, const FitResult& null,
                      const FitResult& linearisation);

// Sets the evidence and its logarithm.
void SetEvidence(const Evidence& evidence, Hypothesis* hypothesis);

}  // namespace sightline
