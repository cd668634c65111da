// SPDX-License-Identifier: Apache-2.0
// Which of the light paths that the null model leaves out explains recordings.
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "render_worker/scene_diagnosis/block_means.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/path_fit.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// An explanation with its fits: one for every choice of shapes, of which the best is kept.
struct Hypothesis {
  std::vector<std::string> effects;  // empty: none
  std::string stage;
  double log_prior = 0;
  double log_predictive = -std::numeric_limits<double>::infinity();  // mean over the shapes
  PathFit best;                                                      // refers to the light's paths
  double probability = 0;                                            // among those compared

  std::string Name() const;  // "none", or effects with " + " between
};

struct PathComparison {
  // In the order of their making: none, each effect alone, pairs, a free smooth map.
  std::vector<Hypothesis> hypotheses;
  // False: stopped; the hypotheses there are were compared.
  bool finished = true;
  // Paths of the free map's fits.
  std::vector<std::vector<LightPath>> maps;
};

struct PathComparisonSettings {
  std::vector<std::string> excluded_effects;
  int max_effects = 2;  // at once; 1 or 2
  // Only none and each effect alone.
  bool singles_only = false;
};

// The null model's paths with one that it leaves out, with two of them, with a free smooth map.
// `progress`: fraction done and what is being compared; false: stops after the null model at the
// earliest. Fits go one after the other: the same answer for any number of threads.
PathComparison ComparePaths(const RecordedScene& scene, const SceneLight& light,
                            const BlockMeans& blocks, const PathComparisonSettings& settings,
                            const std::function<bool(double, std::string_view)>& progress);

}  // namespace sightline
