// SPDX-License-Identifier: Apache-2.0
// Selects the answer among the compared models, by evidence and by the prediction of recordings
// that were not fitted.
#pragma once

#include <optional>
#include <vector>

namespace sightline {

// Nats of log score that effects or a discrepancy term must gain on held-out recordings over the
// model without them: odds of 20, "strong" (Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773).
inline constexpr double kClearGain_nats = 3;
// A model is rejected by its predictions below this p-value.
inline constexpr double kRejectedBelow = 0.01;
// Largest share of the difference (ShareLeft) that a named model may leave as the answer. Chosen:
// on sets of an independent simulator true names leave 0 to 2 %.
inline constexpr double kShareNamesMayLeave = 0.05;
// The same if errors of the fast model are negligible: the expectation is corrected by renderings
// of the named model, or its effects change the recordings too little. Only errors of the effects'
// own models remain. Chosen.
inline constexpr double kShareExactNamesMayLeave = 0.01;

enum class ModelKind {
  kNoEffect,
  kNamed,        // effects of the vocabulary
  kDiscrepancy,  // a model-discrepancy term, alone or with named effects
};

// One of the compared models.
struct ComparedModel {
  ModelKind kind = ModelKind::kNamed;
  // Indices of the models whose effects and terms are a proper subset of its own; the model without
  // effects is a part of every other one.
  std::vector<int> parts = {};
  double log_evidence =
      0;                 // over the model without effects, discounted for the model's errors [nats]
  double log_prior = 0;  // [nats]
  double held_out_score = 0;   // log predictive density of recordings not fitted [nats]
  double held_out_excess = 0;  // their chi squared over degrees of freedom, minus 1
};

// The difference between recordings and null model that the answer leaves unexplained.
struct Remainder {
  int discrepancy = -1;  // the model with a discrepancy term that describes it best; -1: none does
  double share = 0;      // ShareLeft of the answer, in [0, 1]
  double probability = 0;  // that it is physics which the vocabulary lacks, in [0, 1]
  // Only the share decides: rule (b) is met except for it.
  bool small_share_decides = false;
};

struct Judgement {
  // Probability of every model, sum 1; 0 with a discrepancy term unless such a model is the answer.
  std::vector<double> probability;
  int answer = 0;      // the most probable model
  int best_named = 0;  // the most probable one without a discrepancy term
  std::optional<Remainder> remainder;
};

// True for every model that gains more than kClearGain_nats of held-out score over each of its
// parts: rule (a), the same for named effects and discrepancy terms. Always true for the model
// without effects.
std::vector<bool> Predicting(const std::vector<ComparedModel>& models);

// Share of the difference from the null model `none` that a model leaves, in [0, 1]; 1 for the null
// model itself. It is the larger of two ratios: the model's excess over that of the null model, if
// that is positive; and, if a model `discrepancy` predicts better than the null model, the held-out
// score that `model` lacks to it, over the score that the null model lacks. The excess is 0 if
// covariances are conservative; the score is uninformative if the discrepancy itself leaves much.
double ShareLeft(const ComparedModel& model, const ComparedModel& none,
                 const ComparedModel* discrepancy);

// Index of the most probable model without a discrepancy term, by evidence and prior. `models` must
// contain one of kind kNoEffect.
int BestNamed(const std::vector<ComparedModel>& models);

// Selects the answer among models that predict. `models` must contain one of kind kNoEffect.
// `best_named_p_value`: of the predictive check of BestNamed, in [0, 1]. `share_names_may_leave`:
// in [0, 1].
//
// (b) A model with a discrepancy term is the answer only if it has more evidence than the best
//     named model, predicts better by more than kClearGain_nats, and the named model leaves more
//     than `share_names_may_leave` of the difference. If the named model is rejected, unknown
//     physics is at least as probable as ProbabilityOfUnknown states.
// (c) Otherwise the best named model is the answer, and its unexplained part is the remainder.
//     It exists if a discrepancy term predicts or if the named model is rejected.
Judgement Judge(const std::vector<ComparedModel>& models, double best_named_p_value,
                double share_names_may_leave = kShareNamesMayLeave);

}  // namespace sightline
