// SPDX-License-Identifier: Apache-2.0
// Posterior probabilities of compared light paths, by the rules that plates and parts share
// (render_worker/evidence/judgement.h).
#pragma once

#include <optional>
#include <vector>

#include "render_worker/evidence/judgement.h"
#include "render_worker/scene_diagnosis/fit/path_hypothesis.h"

namespace sightline {

struct JudgedPaths {
  std::vector<double> probability;  // of every hypothesis, sum 1
  std::vector<bool> predicts;       // gains 3 nats on held-out tiles over each of its parts
  // Its `discrepancy` is an index of the hypotheses.
  std::optional<Remainder> remainder;
};

// `hypotheses`: the null model first, with fits, scores and priors. Only hypotheses that predict
// held-out tiles have a probability. The smooth map leads only if it has more evidence than the
// best known path, predicts better by 3 nats, and that path leaves more than 5 % of the excess. A
// p-value is not used, since the excess of held-out chi squared contains errors of light
// transport.
JudgedPaths JudgePaths(const std::vector<PathHypothesis>& hypotheses);

}  // namespace sightline
