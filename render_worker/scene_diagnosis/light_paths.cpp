// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/light_paths.h"

#include <utility>

#include "core/status/status_macros.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/scene_diagnosis/light/diffracted_light.h"
#include "render_worker/scene_diagnosis/light/path_catalogue.h"
#include "render_worker/scene_diagnosis/light/path_renderer.h"

namespace sightline {
namespace {

// Images of a recording besides those for every width and radius: direct light, interreflection,
// surround light, lamps, interreflection of lamps.
constexpr int kImagesWithoutShapes = 5;

// One recording by light path, at factor 1 [electrons].
struct RecordingLight {
  std::vector<Image<double>> electrons;  // in the order of the catalogue
  Image<double> diffracted_laser;
  SeenSurface surface;
};

// All that the renderings of one recording have in common.
struct TracedRecording {
  const RecordedScene& scene;
  const LightPathSettings& settings;
  const PathCatalogue& catalogue;
  int index;  // of the recording
  PathRenderer* renderer;

  RecordingKind kind() const {
    return scene.recordings.recordings[static_cast<size_t>(index)].kind;
  }
};

Image<double> ScaledDifference(const Image<double>& a, const Image<double>& b, double factor) {
  Image<double> difference = a;
  for (size_t i = 0; i < a.values.size(); ++i) {
    difference.values[i] = factor * (a.values[i] - b.values[i]);
  }
  return difference;
}

// Images of stray light and veiling glare: the difference to direct light, at factor 1.
absl::Status TraceShapes(const TracedRecording& traced, const Image<double>& direct,
                         RecordingLight* light) {
  const PathCatalogue& catalogue = traced.catalogue;
  for (const size_t path : catalogue.stray_light) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto wide,
        traced.renderer->Render(traced.index, {.stray_width_m = catalogue.paths[path].shape},
                                /*layers=*/false));
    light->electrons[path] = ScaledDifference(wide.image.mean_photo_electrons, direct, 1);
  }
  for (const size_t path : catalogue.veiling_glare) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto halo,
        traced.renderer->Render(traced.index, {.halo_radius_m = catalogue.paths[path].shape},
                                /*layers=*/false));
    light->electrons[path] =
        ScaledDifference(halo.image.mean_photo_electrons, direct, 1 / kRenderedGlareFraction);
  }
  return absl::OkStatus();
}

// Laser light of the null model, and laser light that it may lack.
absl::Status TraceLaser(const TracedRecording& traced, const RenderedPartFrame& direct,
                        RecordingLight* light) {
  const PathCatalogue& catalogue = traced.catalogue;
  const Image<double>& direct_electrons = direct.image.mean_photo_electrons;
  if (traced.kind() != RecordingKind::kLaser) {
    light->diffracted_laser =
        DiffractedElectrons(direct_electrons, direct.layers->laser_radiance_w_m2_sr);
    light->electrons[catalogue.laser] = direct_electrons;
    return absl::OkStatus();
  }
  const RenderSettings& render = traced.scene.inspection.render;
  const bool nominal = NullModelHasInterreflection(render);
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto reflected,
      traced.renderer->Render(
          traced.index,
          {.interreflection = true,
           .max_bounces = nominal ? render.max_bounces : traced.settings.max_bounces},
          /*layers=*/nominal));
  if (!nominal) {
    light->electrons[*catalogue.laser_interreflection] =
        ScaledDifference(reflected.image.mean_photo_electrons, direct_electrons, 1);
  }
  SIGHTLINE_RETURN_IF_ERROR(TraceShapes(traced, direct_electrons, light));
  const RenderedPartFrame& described = nominal ? reflected : direct;
  light->diffracted_laser = DiffractedElectrons(described.image.mean_photo_electrons,
                                                described.layers->laser_radiance_w_m2_sr);
  light->electrons[catalogue.laser] = described.image.mean_photo_electrons;
  return absl::OkStatus();
}

// Light from all around, and that of the described lamps.
absl::Status TraceOtherLight(const TracedRecording& traced, RecordingLight* light) {
  const PathCatalogue& catalogue = traced.catalogue;
  const int max_bounces = traced.settings.max_bounces;
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto surround,
      traced.renderer->Render(
          traced.index,
          {.laser = false, .max_bounces = max_bounces, .surround_radiance_w_m2_sr = 1},
          /*layers=*/false));
  light->electrons[catalogue.surround] = std::move(surround.image.mean_photo_electrons);
  if (!catalogue.lamps) return absl::OkStatus();
  const int described_bounces = traced.scene.inspection.render.max_bounces;
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto lamps,
      traced.renderer->Render(traced.index,
                              {.laser = false, .lamps = true, .max_bounces = described_bounces},
                              /*layers=*/false));
  if (catalogue.lamp_interreflection) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto reflected,
        traced.renderer->Render(traced.index,
                                {.laser = false, .lamps = true, .max_bounces = max_bounces},
                                /*layers=*/false));
    light->electrons[*catalogue.lamp_interreflection] =
        ScaledDifference(reflected.image.mean_photo_electrons, lamps.image.mean_photo_electrons, 1);
  }
  light->electrons[*catalogue.lamps] = std::move(lamps.image.mean_photo_electrons);
  return absl::OkStatus();
}

absl::StatusOr<RecordingLight> TraceRecording(const TracedRecording& traced) {
  const PathCatalogue& catalogue = traced.catalogue;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto direct,
                             traced.renderer->Render(traced.index, {}, /*layers=*/true));
  const Image<double>& image = direct.image.mean_photo_electrons;
  const Image<double> dark(image.columns_px, image.rows_px, 0.0);
  RecordingLight light;
  light.electrons.assign(catalogue.paths.size(), dark);
  light.diffracted_laser = dark;
  light.surface = {direct.layers->material, direct.layers->depth_m};
  for (const size_t path : {catalogue.dark_charge, catalogue.sensor_offset}) {
    for (double& value : light.electrons[path].values) value = 1;
  }
  if (traced.kind() == RecordingKind::kDark) return light;
  SIGHTLINE_RETURN_IF_ERROR(TraceLaser(traced, direct, &light));
  SIGHTLINE_RETURN_IF_ERROR(TraceOtherLight(traced, &light));
  return light;
}

}  // namespace

absl::StatusOr<SceneLight> TraceLightPaths(const RecordedScene& scene,
                                           const LightPathSettings& settings) {
  const PathCatalogue catalogue = MakePathCatalogue(scene);
  const int recordings = static_cast<int>(scene.recordings.recordings.size());
  const int shapes =
      static_cast<int>(catalogue.stray_light.size() + catalogue.veiling_glare.size());
  PathRenderer renderer(scene, settings, recordings * (kImagesWithoutShapes + shapes));
  SceneLight light;
  light.paths = catalogue.paths;
  bool laser_traced = false;
  for (int r = 0; r < recordings; ++r) {
    const TracedRecording traced{scene, settings, catalogue, r, &renderer};
    auto recording = TraceRecording(traced);
    if (absl::IsCancelled(recording.status()) && laser_traced) break;
    if (!recording.ok()) return recording.status();
    for (size_t path = 0; path < light.paths.size(); ++path) {
      light.paths[path].electrons.push_back(std::move(recording->electrons[path]));
    }
    light.paths[catalogue.laser].diffracted_electrons.push_back(
        std::move(recording->diffracted_laser));
    light.surfaces.push_back(std::move(recording->surface));
    laser_traced = laser_traced || traced.kind() == RecordingKind::kLaser;
  }
  return light;
}

}  // namespace sightline
