// SPDX-License-Identifier: Apache-2.0
// The finding in one sentence for people. DiagnoseScene adds a second one on the remainder.
#pragma once

#include <string>

#include "render_worker/scene_diagnosis/answer/added_light.h"
#include "render_worker/scene_diagnosis/fit/compare_paths.h"
#include "render_worker/scene_diagnosis/fit/path_fit.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// `best`: the most probable hypothesis; `added`: the light that it adds.
std::string SceneFinding(const RecordedScene& scene, const PathHypothesis& best,
                         const PathFit& null_fit, const AddedLight& added);

// The state of an interrupted diagnosis. `recordings`: number of traced ones among
// `all_recordings`.
std::string InterruptedSceneFinding(const PathHypothesis& best, const PathComparison& comparison,
                                    int recordings, int all_recordings);

}  // namespace sightline
