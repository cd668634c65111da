// SPDX-License-Identifier: Apache-2.0
// The rig of a first inspection: mount of camera and laser, and the device that moves rig or part.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/part/part_health.h"
#include "planner_client/inspection_draft/commented_json.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

enum class RigKind {
  kFree,       // camera and laser on stands of their own: the nine parameters of the thesis
  kRigid,      // camera and laser in one housing
  kTurntable,  // the part on a turntable of a URDF file, which also does the stage's travel
  kRobot,      // camera and laser in one housing on a robot of a URDF file
};

struct RigWish {
  RigKind kind = RigKind::kFree;
  // The housing's angles and stand-offs: several for a rigid head that comes in several models or
  // is adjustable; one of each for a robot.
  std::vector<double> triangulation_angles_deg, stand_offs_m;
  // Steps of adjustable angles and camera distances; if unset, any value.
  std::optional<double> angle_step_deg, distance_step_m;
  bool stage_moves_in_height = true;
  // For turntable and robot; `urdf` is the file name to be written into the inspection.
  std::string urdf, tip_link;
};

// Parses free, rigid, turntable or robot; nothing for other names.
std::optional<RigKind> RigKindNamed(const std::string& name);

// Fills in rig, laser.distance_m and measurement. The stand-off is the distance from the laser's
// source to the point where line of sight and laser plane meet. The camera of a housing is beside
// the laser, so its distance is stand-off / cos(triangulation angle). INVALID_ARGUMENT names an
// option that is missing or does not fit the kind, and values outside Table 2.1.
absl::Status DraftRig(const RigWish& wish, const PartHealth& health, v1::Inspection* inspection,
                      FieldComments* comments);

}  // namespace sightline
