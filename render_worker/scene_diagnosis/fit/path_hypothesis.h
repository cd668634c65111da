// SPDX-License-Identifier: Apache-2.0
// The null model with the light paths of some effects, and its score.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "render_worker/evidence/evidence.h"
#include "render_worker/scene_diagnosis/fit/path_fit.h"

namespace sightline {

// A hypothesis; each choice of shapes is fitted.
struct PathHypothesis {
  std::vector<std::string> effects;  // empty: none
  std::string stage;                 // the first effect's
  double log_prior = 0;
  double log_predictive = -std::numeric_limits<double>::infinity();  // mean over the shapes
  PathFit best;  // of the best shapes; refers to the light's paths
  // True if it gains 3 nats on held-out tiles over the null model and over each of its effects.
  bool predicts = true;
  double probability = 0;  // posterior, among the hypotheses compared

  std::string Name() const;  // "none", or effects with " + " between

  // The terms of `log_predictive`, and `log_prior`. Fit and covariance are those of all tiles; the
  // mean over the shapes is taken as the prior of these parameters.
  Evidence Terms() const;
};

}  // namespace sightline
