// SPDX-License-Identifier: Apache-2.0
// Description of a scene: validation, normal form and digest of a SceneSpec.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coverage_server/scene/coverage_scene.h"
#include "sightline/v1/coverage_service.pb.h"

namespace sightline {

struct ParsedSceneSpec {
  v1::SceneSpec normalised;
  std::string digest;
  // Equal for all scenes in which a scan measures the same points; independent of their targets.
  std::string geometry_digest;
  std::string part_digest;
  bool part_has_materials = false;  // the part is named with materials (PartNameWithMaterials)
  // All of the scene except the meshes, which are named by their digests.
  Rig rig;
  TargetSampling sampling;
  int field_directions = kDefaultFieldDirections;
  std::optional<UncertaintyModel> uncertainty;
  std::optional<MeasurementDomain> domain;
  std::optional<Detectability> detectability;
  struct ObstacleRef {
    std::string part_digest;
    ObstacleFrame frame;
  };
  std::vector<ObstacleRef> obstacles;
};

// The normal form has every default written out, so that equal scenes have equal bytes; it is its
// own normal form. Digest: SHA-256 (lower-case hex) of the deterministic serialization of the
// normal form. INVALID_ARGUMENT with the invalid fields.
absl::StatusOr<ParsedSceneSpec> ParseSceneSpec(const v1::SceneSpec& spec);

}  // namespace sightline
