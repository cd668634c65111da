// SPDX-License-Identifier: Apache-2.0
// Bayesian comparison of the light paths that the null model may lack: the null model alone, with
// one of them, with two of them, and with a smooth map for light of unknown origin.
//
// The score of a hypothesis is log prior + log marginal likelihood on the tiles of the fit + log
// predictive density on the held-out tiles (fit/path_fit.h), averaged over its shapes. Priors are
// those of render_worker/evidence/model_prior.h; fit/judge_paths.h selects the leading hypothesis.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_worker/evidence/judgement.h"
#include "render_worker/scene_diagnosis/block/block_means.h"
#include "render_worker/scene_diagnosis/fit/path_hypothesis.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

struct PathComparison {
  // In this order: none, each effect alone, pairs, the smooth map.
  std::vector<PathHypothesis> hypotheses;
  // False: interrupted; `hypotheses` contains those compared so far.
  bool finished = true;
  // The part that the leading hypothesis leaves; its `discrepancy` is an index of `hypotheses`.
  std::optional<Remainder> remainder;
  // Light paths of the smooth map at each scale, referenced by fits.
  std::vector<std::vector<LightPath>> maps;
};

struct PathComparisonSettings {
  std::vector<std::string> excluded_effects;
  int max_effects = 2;  // of a hypothesis; 1 or 2
  // Only compares none and each effect alone.
  bool singles_only = false;
};

// Gets the fraction done and the name of the next hypothesis; returns false to stop.
using PathComparisonProgress = std::function<bool(double fraction, std::string_view what)>;

// The answer contains at least the null model, even if `progress` stops at once. Fits run one after
// the other, so the answer does not depend on the number of threads.
PathComparison ComparePaths(const RecordedScene& scene, const SceneLight& light,
                            const BlockMeans& blocks, const PathComparisonSettings& settings,
                            const PathComparisonProgress& progress);

}  // namespace sightline
