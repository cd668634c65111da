// SPDX-License-Identifier: Apache-2.0
// Prior probabilities of models, alike for plates, parts and cameras.
#pragma once

namespace sightline {

// Three in ten sets are believed to be as described: users mostly ask after they saw something.
inline constexpr double kPriorOfNoEffect = 0.3;
// One in ten of the others follows a law that is not in the vocabulary.
inline constexpr double kPriorOfUnknown = 0.1;
// One in ten of those with a known effect has one more.
inline constexpr double kPriorOfOneMore = 0.1;
// Half of the laws that are not in the vocabulary are near a known one.
inline constexpr double kPriorOfNearKnown = 0.5;

// The models among which the priors are shared out.
struct ModelCounts {
  int effects = 0;            // of the vocabulary, at least 1
  int discrepancy_terms = 0;  // 0: counted as one
  int stages = 6;             // that share the discrepancy terms
};

// Logarithm of the prior probability of the model without effects.
double LogPriorOfNoEffect();
// The same of one model of `effects` >= 1 named effects.
double LogPriorOfNamed(const ModelCounts& counts, int effects);
// The same of one model with `terms` >= 1 discrepancy terms of one stage, by themselves or beside a
// named effect.
double LogPriorOfDiscrepancy(const ModelCounts& counts, bool beside_named_effect, int terms = 1);

}  // namespace sightline
