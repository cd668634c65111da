// SPDX-License-Identifier: Apache-2.0
// Prior probabilities of models, shared by plates, parts and cameras.
#pragma once

namespace sightline {

// Prior belief that a set is as described: users mostly ask after they have seen a problem.
inline constexpr double kPriorOfNoEffect = 0.3;
// Prior belief that another set follows physics outside the vocabulary.
inline constexpr double kPriorOfUnknown = 0.1;
// Prior belief that a set with a known effect has one more.
inline constexpr double kPriorOfOneMore = 0.1;
// Prior belief that physics outside the vocabulary is close to a known effect.
inline constexpr double kPriorOfNearKnown = 0.5;

// Numbers of models that share the prior probability.
struct ModelCounts {
  int effects = 0;            // of the vocabulary, at least 1
  int discrepancy_terms = 0;  // 0: counted as one
  int stages = 6;             // number of stages that share the discrepancy terms
};

// Logarithm of the prior probability of the model without effects.
double LogPriorOfNoEffect();
// The same of one model of `effects` >= 1 named effects.
double LogPriorOfNamed(const ModelCounts& counts, int effects);
// The same of one model with `terms` >= 1 discrepancy terms of one stage, alone or in addition to a
// named effect.
double LogPriorOfDiscrepancy(const ModelCounts& counts, bool beside_named_effect, int terms = 1);

}  // namespace sightline
