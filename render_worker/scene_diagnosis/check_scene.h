// SPDX-License-Identifier: Apache-2.0
// Checks that the images of a scene belong to its description.
#pragma once

#include "absl/status/status.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// INVALID_ARGUMENT: another format version than 2; sensor or lens missing; number or size of images
// other than described; a raw number above the sensor's largest; a focus too near for the lens.
// FAILED_PRECONDITION: no recording with the laser on.
absl::Status CheckRecordedScene(const RecordedScene& scene);

}  // namespace sightline
