// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/light/path_renderer.h"

#include <algorithm>
#include <numbers>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"
#include "render_worker/effects/vocabulary.h"
#include "render_worker/scene_diagnosis/light/path_catalogue.h"

namespace sightline {
namespace {

// The nominal inspection with the recording's exposure and the light of the variant.
Inspection InspectionOf(const Inspection& nominal, const RecordedImage& recorded, uint64_t seed,
                        const LightVariant& variant) {
  Inspection inspection = nominal;
  inspection.render.speckle = false;
  inspection.render.seed = static_cast<int64_t>(seed);
  inspection.render.exposure_time_s = recorded.exposure_time_s;
  inspection.render.max_bounces = variant.max_bounces;
  inspection.render.laser_interreflection = variant.interreflection;
  inspection.effects.clear();
  inspection.rig.lens->f_number = recorded.f_number;
  if (!variant.laser || recorded.kind != RecordingKind::kLaser) inspection.rig.laser.power_w = 0;
  if (!variant.lamps) inspection.lighting.Clear();
  if (variant.surround_radiance_w_m2_sr) {
    v1::Lighting surround;
    surround.mutable_ambient()->set_radiance_w_m2_sr(*variant.surround_radiance_w_m2_sr);
    surround.mutable_ambient()->mutable_spectrum()->set_illuminant("d65");
    inspection.lighting = surround;
  }
  if (variant.stray_width_m) {
    // A Gaussian beam of waist w and divergence theta has M^2 = pi w theta / lambda (ISO 11146-1).
    Laser& laser = inspection.rig.laser;
    laser.beam_quality_m2 =
        *variant.stray_width_m * std::numbers::pi * laser.divergence_rad / laser.wavelength_m;
  }
  return inspection;
}

absl::StatusOr<std::vector<ActiveEffect>> EffectsOf(const LightVariant& variant) {
  if (!variant.halo_radius_m) return std::vector<ActiveEffect>();
  SIGHTLINE_ASSIGN_OR_RETURN(auto glare,
                             MakeActiveEffect(VeilingGlare().description().id,
                                              {{"glare_fraction", kRenderedGlareFraction},
                                               {"halo_radius_m", *variant.halo_radius_m}}));
  return std::vector<ActiveEffect>{std::move(glare)};
}

}  // namespace

PathRenderer::PathRenderer(const RecordedScene& scene, const LightPathSettings& settings,
                           int images)
    : scene_(scene), settings_(settings), images_(images) {}

absl::StatusOr<RenderedPartFrame> PathRenderer::Render(int recording, const LightVariant& variant,
                                                       bool layers) {
  const RecordedImage& recorded = scene_.recordings.recordings[static_cast<size_t>(recording)];
  PartSceneInput input;
  input.inspection = InspectionOf(scene_.inspection, recorded, settings_.seed, variant);
  input.part = scene_.part;
  input.obstacles = scene_.obstacles;
  input.assets = scene_.assets;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto effects, EffectsOf(variant));
  SIGHTLINE_ASSIGN_OR_RETURN(auto part_scene, PartScene::Make(std::move(input)));
  RenderLimits limits;
  limits.threads = settings_.threads;
  limits.max_image_bytes = settings_.max_image_bytes;
  limits.cancelled = settings_.cancelled;
  auto frame = RenderPartFrame(*part_scene, {recorded.measurement, recorded.stage_position_m},
                               effects, layers, limits);
  ++done_;
  if (settings_.progress) settings_.progress(std::min(1.0, done_ / double(images_)));
  return frame;
}

}  // namespace sightline
