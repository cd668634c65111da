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
// The share of the difference (ShareLeft) that a named model may leave and still be the answer.
// Chosen: on sets of an independent simulator true names leave 0 to 2 %.
inline constexpr double kShareNamesMayLeave = 0.05;
// The same where errors of the fast model are negligible: the expectation is corrected by
// renderings of the named model, or its effects change the recordings too little. Left are errors
// of the effects' laws. Chosen.
inline constexpr double kShareExactNamesMayLeave = 0.01;

enum class ModelKind {
  kNoEffect,
  kNamed,        // effects of the vocabulary
  kDiscrepancy,  // a model-discrepancy term, alone or with named effects
};

// One of the compared models.
struct ComparedModel {
  ModelKind kind = ModelKind::kNamed;
  // Indices of the models that lack some of its effects or terms and have no other ones; the model
  // without effects is a part of every other one.
  std::vector<int> parts = {};
  double log_evidence = 0;     // over the model without effects, model's errors allowed for [nats]
  double log_prior = 0;        // [nats]
  double held_out_score = 0;   // log predictive density of recordings not fitted [nats]
  double held_out_excess = 0;  // their chi squared over degrees of freedom, minus 1
};

// The difference between recordings and null model that the answer leaves unexplained.
struct Remainder {
  int discrepancy = -1;  // the model with a discrepancy term that describes it best; -1: none does
  double share = 0;      // ShareLeft of the answer, in [0, 1]
  double probability = 0;  // that it is physics which the vocabulary lacks, in [0, 1]
  // The share alone decides: rule (b) is met but for it.
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
// parts: rule (a), the same for named effects and discrepancy terms. The model without effects
// always is.
std::vector<bool> Predicting(const std::vector<ComparedModel>& models);

// The share of the difference from the null model `none` that a model leaves, in [0, 1]; 1 for the
// null itself. It is the larger of two: the excess over that of the null, where the null leaves
// one; and, with a model `discrepancy` that predicts better than the null, the held-out score by
// which `model` is behind it, over that by which the null is. The excess is 0 where covariances are
// conservative, the score says nothing where the discrepancy itself leaves much.
double ShareLeft(const ComparedModel& model, const ComparedModel& none,
                 const ComparedModel* discrepancy);

// Index of the most probable model without a discrepancy term, by evidence and prior. `models`: one
// of kind kNoEffect among them.
int BestNamed(const std::vector<ComparedModel>& models);

// The answer among models that predict. `models`: one of kind kNoEffect among them.
// `best_named_p_value`: of the predictive check of BestNamed, in [0, 1].
// `share_names_may_leave`: in [0, 1].
//
// (b) A model with a discrepancy term is the answer only if it has more evidence than the best
//     named one, predicts better by more than kClearGain_nats, and that one leaves more than
//     `share_names_may_leave` of the difference. If that one is rejected, unknown physics is at
//     least as probable as ProbabilityOfUnknown says.
// (c) Otherwise the best named model is the answer, and what it leaves is the remainder: there is
//     one if a discrepancy term predicts or if the named model is rejected.
Judgement Judge(const std::vector<ComparedModel>& models, double best_named_p_value,
                double share_names_may_leave = kShareNamesMayLeave);

}  // namespace sightline
