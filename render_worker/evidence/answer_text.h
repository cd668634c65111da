// SPDX-License-Identifier: Apache-2.0
// Sentences about the remainder of the answer and about models with a discrepancy term, shared by
// plates and parts.
#pragma once

#include <string>

#include "render_worker/evidence/judgement.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// True if the answer is the null model although its predictions reject it.
bool NullIsRejectedAnswer(const v1::Diagnosis& diagnosis);

// One sentence on `diagnosis.remainder`, e.g. "2 % of the difference is left, mostly in texture; no
// known effect describes it (probability 0.97)."; of a null model only if it is rejected. Empty if
// there is no remainder or if its probability is at most 0.5.
std::string RemainderText(const v1::Diagnosis& diagnosis);

// Comparison of a model with a discrepancy term with the best named model, which is the answer.
struct TermOverName {
  double more_evidence = 0;        // [nats]
  double more_held_out_score = 0;  // [nats]
  double share_left = 0;           // by the named model (ShareLeft), in [0, 1]
  double share_names_may_leave = kShareNamesMayLeave;
};

// Text of the first condition of Judge (judgement.h, rule b) that the model with the term fails.
// `more_held_out_score` only counts if the other two are fulfilled.
std::string WhyTermDoesNotLead(const TermOverName& term);

}  // namespace sightline
