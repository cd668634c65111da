// SPDX-License-Identifier: Apache-2.0
// Lamps and ambient over a sub-pixel grid.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/light_transport/light_transport.h"
#include "render_worker/light_transport/scene.h"

namespace sightline {

// As LightTransport::TraceIncoherent.
absl::StatusOr<IncoherentTransport> TraceIncoherentLight(
    const RayScene& scene, const SceneView& view, const SubPixelGrid& grid,
    const std::vector<Spectrum>& channel_weights, const TransportSettings& settings,
    const TransportProgress& progress);

}  // namespace sightline
