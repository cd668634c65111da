// SPDX-License-Identifier: Apache-2.0
// Distinguishability of a concealed effect: the log-likelihood that the nearest other explanation
// is expected to lose on the recordings of a set (Lundgren and Jung, arXiv 2009.04756). No method
// can name what loses next to nothing.
//
//   D = min over effects n of  1/2 min over strengths of n and the set-up of
//         |L^-1 (mu_true - mu_n)|^2 + the prior penalty          [nats]
//
// mu: expected statistics of the set (SetModel), L L' their covariance without effects.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline::bench {

struct OtherExplanation {
  const Effect* effect = nullptr;  // nullptr: the set-up without effects
  double left_nats = 0;            // expected loss against the truth, refitted
};

struct Distinguishability {
  double gain_nats = 0;  // loss of the refitted set-up without effects
  // Refitted explanations, the nearest first; the set-up without effects is among them.
  std::vector<OtherExplanation> others;
  double nats() const { return others.front().left_nats; }
};

struct NearestSettings {
  int refits = 8;  // most promising effects that are refitted without linearisation; > 0
  int threads = 2;
};

// `truth`: the true effects, all that the expectation shows. `at`: true deviations, no effects.
// `not_these`: ids that count as the truth. The vocabulary is compared without effects with a
// random law: those have no expectation of their own.
Distinguishability NearestExplanation(const RecordedSet& set,
                                      const std::vector<ActiveEffect>& truth,
                                      const SetParameters& at,
                                      const std::vector<std::string>& not_these,
                                      const NearestSettings& settings);

// "< 3", "3-10" or "> 10".
std::string_view BinOfNats(double nats);

}  // namespace sightline::bench
