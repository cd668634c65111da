// SPDX-License-Identifier: Apache-2.0
// Meshes of virtual artefacts, for the renderer.
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "core/acceptance/artefact.h"

namespace sightline {

struct ArtefactMesh {
  std::string stl;            // binary, metres
  Eigen::AlignedBox3d box_m;  // the renderer places the middle of this box
};

// On spheres and bores, facets are half a degree wide and deviate from the surface by 1e-5 of its
// radius. A sphere is only the half that points towards camera and laser.
ArtefactMesh MeshOfArtefact(const Artefact& artefact);

}  // namespace sightline
