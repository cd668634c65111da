// SPDX-License-Identifier: Apache-2.0
// Laser light over a sub-pixel grid.
#pragma once

#include "absl/status/statusor.h"
#include "render_worker/light_transport/light_transport.h"
#include "render_worker/light_transport/scene.h"

namespace sightline {

// As LightTransport::TraceLaser.
absl::StatusOr<LaserTransport> TraceLaserLight(const RayScene& scene, const SceneView& view,
                                               const SubPixelGrid& grid,
                                               const TransportSettings& settings,
                                               const TransportProgress& progress);

}  // namespace sightline
