// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/light_transport.h"

#include <utility>

#include "core/status/status_macros.h"
#include "render_worker/light_transport/lamps/incoherent_transport.h"
#include "render_worker/light_transport/laser/laser_transport.h"
#include "render_worker/light_transport/scene.h"

namespace sightline {
namespace {

class SceneLightTransport : public LightTransport {
 public:
  explicit SceneLightTransport(std::unique_ptr<RayScene> scene) : scene_(std::move(scene)) {}

  absl::StatusOr<LaserTransport> TraceLaser(const SceneView& view, const SubPixelGrid& grid,
                                            const TransportSettings& settings,
                                            const TransportProgress& progress) const override {
    return TraceLaserLight(*scene_, view, grid, settings, progress);
  }

  absl::StatusOr<IncoherentTransport> TraceIncoherent(
      const SceneView& view, const SubPixelGrid& grid, const std::vector<Spectrum>& channel_weights,
      const TransportSettings& settings, const TransportProgress& progress) const override {
    return TraceIncoherentLight(*scene_, view, grid, channel_weights, settings, progress);
  }

 private:
  std::unique_ptr<RayScene> scene_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<LightTransport>> LightTransport::Make(SceneDescription description) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto scene, RayScene::Make(std::move(description)));
  return std::make_unique<SceneLightTransport>(std::move(scene));
}

}  // namespace sightline
