// SPDX-License-Identifier: Apache-2.0
// Renders a recording with a subset of its light, without speckle and noise.
#pragma once

#include <optional>

#include "absl/status/statusor.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// The light of one rendering.
struct LightVariant {
  bool laser = true;  // only if the recording has laser light
  bool lamps = false;
  bool interreflection = false;
  int max_bounces = 0;
  // Replaces the laser's beam by a wide Gaussian of this half width at its waist [m].
  std::optional<double> stray_width_m = {};
  // Replaces the described lamps by uniform light from all directions, of illuminant D65.
  std::optional<double> surround_radiance_w_m2_sr = {};
  // Veiling glare of this radius, with kRenderedGlareFraction of the light in the halo [m].
  std::optional<double> halo_radius_m = {};
};

class PathRenderer {
 public:
  // Progress 1 is reached after `images` renderings. Scene and settings must outlive this object.
  PathRenderer(const RecordedScene& scene, const LightPathSettings& settings, int images);

  // `recording`: index into the set's recordings. `layers`: also return radiance, depth and
  // material. Errors of PartScene::Make and RenderPartFrame.
  absl::StatusOr<RenderedPartFrame> Render(int recording, const LightVariant& variant, bool layers);

 private:
  const RecordedScene& scene_;
  const LightPathSettings& settings_;
  const int images_;
  int done_ = 0;
};

}  // namespace sightline
