// SPDX-License-Identifier: Apache-2.0
// Recordings of a part (format version 2) and the inputs of its nominal model.
#pragma once

#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/recordings/part_inspection.h"
#include "core/recordings/recordings.h"
#include "render_worker/material/material.h"

namespace sightline {

// The inputs of a render job of the same part, and the images.
struct RecordedScene {
  // Nominal description: rig, part, materials, lights. The null model contains the light of its
  // render settings render.laser_interreflection and render.max_bounces. Exposure time and f-number
  // are those of each recording.
  Inspection inspection;
  TriangleMesh part;
  std::vector<TriangleMesh> obstacles;  // in the order of inspection.obstacles
  AssetResolver assets;
  RecordingSet recordings;              // format version 2
  std::vector<Image<uint16_t>> raw_dn;  // one for every recording, of its region's size
};

}  // namespace sightline
