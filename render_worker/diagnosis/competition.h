// Which effects, singly and together, explain a set best.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "render_worker/diagnosis/candidate.h"
#include "render_worker/diagnosis/screening.h"

namespace sightline {

struct Competition {
  FitResult null;                 // under the covariance of all candidates
  std::vector<Candidate> ranked;  // most probable first; the null model among them
  std::vector<ScreenedEffect> screened;
  // Effects whose change no fitted parameter can tell from that of ranked.front()'s first effect:
  // squared cosine above 0.98.
  std::vector<const Effect*> same_class;
};

struct CompetitionSettings {
  std::span<const Effect* const> effects;     // to consider, of the vocabulary
  std::span<const Effect* const> free_forms;  // terms of unknown physics, singly only
  int max_effects = 2;
};

// Every effect starts from a few strengths and shapes on the null model; the most promising are
// fitted together with all known parameters, then again under the covariance of the best. False
// from `progress` (fraction done): stops, with what there is.
Competition Compete(const SetModel& model, const FitResult& null,
                    const CompetitionSettings& settings,
                    const std::function<bool(double)>& progress);

}  // namespace sightline
