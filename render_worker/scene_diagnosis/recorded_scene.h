// Recordings of a part (format version 2) with all that its nominal model is computed from.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/recordings/recordings.h"
#include "render_worker/material/material.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// The inputs of a render job of the same part, and the images.
struct RecordedScene {
  // Nominal description: rig, part, materials, lights. Its render settings say what the null model
  // contains: render.laser_interreflection, render.max_bounces. Exposure time and f-number are
  // those of each recording.
  Inspection inspection;
  TriangleMesh part;
  std::vector<TriangleMesh> obstacles;  // in the order of inspection.obstacles
  AssetResolver assets;
  RecordingSet recordings;              // format version 2
  std::vector<Image<uint16_t>> raw_dn;  // one for every recording, of its region's size
};

// The inspection that recordings.json of version 2 describes: part, lens, laser, materials, lights,
// sensor; laser light between surfaces is left out of its render settings, as is everything the
// file does not know (obstacles, unit of the part's file: set part.unit for STL, PLY, OBJ). File
// names are as they stand there. INVALID_ARGUMENT: format version 1; regions that differ or are not
// the middle of the sensor, since a part's image has the principal point in its centre.
absl::StatusOr<v1::Inspection> InspectionOfRecordings(const v1::Recordings& recordings,
                                                      const std::string& context);

}  // namespace sightline
