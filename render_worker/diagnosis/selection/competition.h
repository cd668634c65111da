// SPDX-License-Identifier: Apache-2.0
// Which effects, singly and together, explain a set best.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/predictive_check.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/screening.h"

namespace sightline {

struct Competition {
  // False: stopped by `progress`. Then there are `null`, `screened` and `ranked` so far, by
  // evidence alone: nothing has been held to predictions.
  bool finished = true;
  FitResult null;                 // under the covariance of all candidates
  std::vector<Candidate> ranked;  // most probable first; the null model among them
  std::vector<ScreenedEffect> screened;
  // Effects whose change no fitted parameter can tell from that of ranked.front()'s first effect:
  // squared cosine above 0.98.
  std::vector<const Effect*> same_class;
  // Of the null model, and of the most probable candidate that is not of unknown physics (which
  // may be the null model): what it predicts decides whether it may be named.
  PredictiveCheck null_check, named_check;
  Candidate named;
};

struct CompetitionSettings {
  std::span<const Effect* const> effects;     // to consider, of the vocabulary
  std::span<const Effect* const> free_forms;  // terms of unknown physics, singly only
  int max_effects = 2;
  uint64_t seed = 1;  // of the recordings that are held out
};

// Every effect starts from a few strengths and shapes on the null model; the most promising are
// fitted together with all known parameters, then again under the covariance of the best. What is
// named must predict recordings that were not fitted: effects that do not predict them clearly
// better than the model without them are no candidates, and the less the best of the vocabulary
// predicts them (BayesFactorBound), the more probable is unknown physics. False from `progress`
// (fraction done): stops, with what there is (Competition::finished).
Competition Compete(const SetModel& model, const FitResult& null,
                    const CompetitionSettings& settings,
                    const std::function<bool(double)>& progress);

}  // namespace sightline
