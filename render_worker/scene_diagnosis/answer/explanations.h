// SPDX-License-Identifier: Apache-2.0
// The ranking of hypotheses in the answer: effects with fitted parameters, probabilities of
// hypotheses and stages, and detectable strengths.
#pragma once

#include <vector>

#include "render_worker/scene_diagnosis/answer/excess_region.h"
#include "render_worker/scene_diagnosis/fit/compare_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Sorted by descending probability, then by score and prior, then in the order of the
// comparison.
std::vector<const PathHypothesis*> RankHypotheses(const std::vector<PathHypothesis>& hypotheses);

// Adds `ranked`, `remainder` and the probabilities of the stages. `region`: region in which the
// light of the first hypothesis is significant.
void AddExplanations(const RecordedScene& scene, const PathComparison& comparison,
                     const std::vector<const PathHypothesis*>& ranked, const ExcessRegion& region,
                     v1::Diagnosis* diagnosis);

// Adds for each effect alone the smallest factor that these recordings show clearly: an expected
// gain of 5 nats of log-likelihood, equal to a chi squared of 10.
void AddDetectableStrengths(const std::vector<PathHypothesis>& hypotheses,
                            v1::Diagnosis* diagnosis);

}  // namespace sightline
