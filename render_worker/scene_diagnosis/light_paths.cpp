// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/light_paths.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "render_worker/render/part_frame.h"

namespace sightline {
namespace {

// Standard deviation of a scale the description states but gives no uncertainty of: power, albedo
// and transmission of a rig that nobody has calibrated.
constexpr double kUnstatedScale = 0.3;
// Interreflected light goes with the square of the albedo.
constexpr double kInterreflectionScale = 0.5;
constexpr double kUnstatedOffset_electrons = 2;
// Stray light of the projector: half width of the light beside the line.
constexpr double kStrayWidths_m[] = {3e-3, 12e-3};
constexpr double kHaloRadii_m[] = {5e-5, 2e-4, 1e-3};
// Fraction of light at which the glare's image is computed; the image is linear in it.
constexpr double kGlare = 0.1;

// Shapes that lie nearer to the i-th than to the others, on a logarithmic scale.
std::pair<double, double> ShapeRange(std::span<const double> shapes, size_t i) {
  const size_t last = shapes.size() - 1;
  const double below = i > 0 ? shapes[i] / shapes[i - 1] : shapes[1] / shapes[0];
  const double above = i < last ? shapes[i + 1] / shapes[i] : shapes[last] / shapes[last - 1];
  return {shapes[i] / std::sqrt(below), shapes[i] * std::sqrt(above)};
}

struct Variant {
  bool laser = true;
  bool lamps = false;
  bool interreflection = false;
  int max_bounces = 0;
  std::optional<double> stray_width_m = {};
  std::optional<double> surround_radiance_w_m2_sr = {};
  std::optional<double> halo_radius_m = {};
};

class Renderer {
 public:
  Renderer(const RecordedScene& scene, const LightPathSettings& settings, int images)
      : scene_(scene), settings_(settings), images_(images) {}

  absl::StatusOr<RenderedPartFrame> Render(int recording, const Variant& variant, bool layers) {
    const RecordedImage& recorded = scene_.recordings.recordings[recording];
    PartSceneInput input;
    input.inspection = scene_.inspection;
    input.part = scene_.part;
    input.obstacles = scene_.obstacles;
    input.assets = scene_.assets;
    Inspection& inspection = input.inspection;
    inspection.render.speckle = false;
    inspection.render.seed = static_cast<int64_t>(settings_.seed);
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
      // A Gaussian beam of that width at its waist.
      Laser& laser = inspection.rig.laser;
      laser.beam_quality_m2 =
          *variant.stray_width_m * std::numbers::pi * laser.divergence_rad / laser.wavelength_m;
    }
    std::vector<ActiveEffect> effects;
    if (variant.halo_radius_m) {
      auto glare =
          MakeActiveEffect("optics.veiling_glare",
                           {{"glare_fraction", kGlare}, {"halo_radius_m", *variant.halo_radius_m}});
      if (!glare.ok()) return glare.status();
      effects.push_back(*std::move(glare));
    }
    auto part_scene = PartScene::Make(std::move(input));
    if (!part_scene.ok()) return part_scene.status();
    RenderLimits limits;
    limits.threads = settings_.threads;
    limits.max_image_bytes = settings_.max_image_bytes;
    limits.cancelled = settings_.cancelled;
    auto frame = RenderPartFrame(**part_scene, {recorded.measurement, recorded.stage_position_m},
                                 effects, layers, limits);
    ++done_;
    if (settings_.progress) settings_.progress(std::min(1.0, done_ / double(images_)));
    return frame;
  }

 private:
  const RecordedScene& scene_;
  const LightPathSettings& settings_;
  const int images_;
  int done_ = 0;
};

Image<double> Difference(const Image<double>& a, const Image<double>& b, double factor) {
  Image<double> difference = a;
  for (size_t i = 0; i < a.values.size(); ++i) {
    difference.values[i] = factor * (a.values[i] - b.values[i]);
  }
  return difference;
}

// What of `electrons` is more than the perfect image within two pixels gives. `radiance`: of that
// image; both hold the same light in all.
Image<double> FromAfar(const Image<double>& electrons, const Image<float>& radiance) {
  constexpr int kNear_px = 2;
  double light = 0, perfect = 0;
  for (const double value : electrons.values) light += value;
  for (const float value : radiance.values) perfect += value;
  Image<double> afar = electrons;
  if (perfect <= 0) return afar;
  for (int i = 0; i < afar.rows_px; ++i) {
    for (int j = 0; j < afar.columns_px; ++j) {
      float near = 0;
      for (int m = std::max(0, i - kNear_px); m <= std::min(afar.rows_px - 1, i + kNear_px); ++m) {
        for (int n = std::max(0, j - kNear_px); n <= std::min(afar.columns_px - 1, j + kNear_px);
             ++n) {
          near = std::max(near, radiance.At(m, n));
        }
      }
      afar.At(i, j) = std::max(0.0, electrons.At(i, j) - light / perfect * near);
    }
  }
  return afar;
}

// Drops the light of recordings behind the first `recordings`.
void KeepFirst(size_t recordings, SceneLight* light) {
  for (LightPath& path : light->paths) {
    path.electrons.resize(recordings);
    if (path.diffracted_electrons.size() > recordings) path.diffracted_electrons.resize(recordings);
  }
  if (light->surfaces.size() > recordings) light->surfaces.resize(recordings);
}

}  // namespace

const std::vector<std::string>& LeftOutEffects() {
  static const auto& effects = *new std::vector<std::string>{
      "illumination.interreflection", "illumination.lamp_interreflection",
      "illumination.ambient_light",   "illumination.laser_stray_light",
      "optics.veiling_glare",         "sensor.black_level_error"};
  return effects;
}

absl::StatusOr<SceneLight> TraceLightPaths(const RecordedScene& scene,
                                           const LightPathSettings& settings) {
  const int recordings = static_cast<int>(scene.recordings.recordings.size());
  const RenderSettings& render = scene.inspection.render;
  const bool all_laser_light = render.laser_interreflection && render.max_bounces > 0;
  const bool all_lamp_light = render.max_bounces > 0;
  const v1::Lighting& lighting = scene.inspection.lighting;
  const bool lamps = lighting.ambient().radiance_w_m2_sr() > 0 || lighting.area_lights_size() > 0;
  const SetupDeviation& stated = scene.recordings.uncertainty;
  // Factors common to all laser light: power, transmission, albedo, quantum efficiency.
  const double stated_scale =
      std::hypot(std::hypot(stated.power_relative, stated.transmission_relative),
                 std::hypot(stated.diffuse_albedo_relative, stated.quantum_efficiency_relative));
  const double scale = stated_scale > 0 ? stated_scale : kUnstatedScale;

  SceneLight light;
  const auto add = [&light, recordings](LightPath path) {
    path.electrons.resize(static_cast<size_t>(recordings));
    light.paths.push_back(std::move(path));
    return light.paths.size() - 1;
  };
  const size_t laser = add({.effect = "laser_factor",
                            .stage = "illumination",
                            .words = "laser light as described",
                            .parameter = "laser_factor",
                            .prior_mean = 1,
                            .prior_standard_deviation = scale,
                            .laser_light = true,
                            .nominal = true});
  const size_t offset =
      add({.effect = "dark_mean_electrons",
           .stage = "sensor",
           .words = "dark charge",
           .parameter = "dark_mean_electrons",
           .prior_standard_deviation = stated.dark_mean_electrons > 0 ? stated.dark_mean_electrons
                                                                      : kUnstatedOffset_electrons,
           .nominal = true,
           .may_be_negative = true});
  std::optional<size_t> lamp;
  if (lamps) {
    lamp = add({.effect = "lamp_factor",
                .stage = "illumination",
                .words = "other light as described",
                .parameter = "lamp_factor",
                .prior_mean = 1,
                .prior_standard_deviation = kUnstatedScale,
                .nominal = true});
  }
  std::optional<size_t> interreflection, lamp_interreflection;
  if (!all_laser_light) {
    interreflection = add({.effect = "illumination.interreflection",
                           .stage = "illumination",
                           .words = "laser light reflected from one surface of the part to another",
                           .parameter = "interreflected_light_factor",
                           .prior_mean = 1,
                           .prior_standard_deviation = kInterreflectionScale,
                           .laser_light = true});
  }
  if (lamps && !all_lamp_light) {
    lamp_interreflection =
        add({.effect = "illumination.lamp_interreflection",
             .stage = "illumination",
             .words = "light of lamps reflected from one surface of the part to another",
             .parameter = "interreflected_light_factor",
             .prior_mean = 1,
             .prior_standard_deviation = kInterreflectionScale});
  }
  const size_t surround = add({.effect = "illumination.ambient_light",
                               .stage = "illumination",
                               .words = "light from all around that is not described",
                               .parameter = "ambient_radiance_w_m2_sr",
                               .prior_standard_deviation = 0.1});
  std::vector<size_t> stray, glare;
  for (size_t i = 0; i < std::size(kStrayWidths_m); ++i) {
    const auto [lower, upper] = ShapeRange(kStrayWidths_m, i);
    stray.push_back(add({.effect = "illumination.laser_stray_light",
                         .stage = "illumination",
                         .words = "light that leaves the projector beside the line",
                         .parameter = "stray_fraction",
                         .prior_standard_deviation = 0.05,
                         .laser_light = true,
                         .shape_name = "half_width_m",
                         .shape = kStrayWidths_m[i],
                         .shape_lower = lower,
                         .shape_upper = upper}));
  }
  for (size_t i = 0; i < std::size(kHaloRadii_m); ++i) {
    const auto [lower, upper] = ShapeRange(kHaloRadii_m, i);
    glare.push_back(add({.effect = "optics.veiling_glare",
                         .stage = "optics",
                         .words = "light scattered in the lens",
                         .parameter = "glare_fraction",
                         .prior_standard_deviation = 0.05,
                         .laser_light = true,
                         .shape_name = "halo_radius_m",
                         .shape = kHaloRadii_m[i],
                         .shape_lower = lower,
                         .shape_upper = upper}));
  }
  const size_t offset_error = add({.effect = "sensor.black_level_error",
                                   .stage = "sensor",
                                   .words = "an offset of the sensor",
                                   .parameter = "black_level_shift_electrons",
                                   .prior_standard_deviation = 20,
                                   .may_be_negative = true});

  Renderer renderer(scene, settings,
                    recordings * (5 + static_cast<int>(stray.size() + glare.size())));
  const auto trace = [&](int r) -> absl::Status {
    const RecordedImage& recorded = scene.recordings.recordings[static_cast<size_t>(r)];
    const bool open = recorded.kind != RecordingKind::kDark;
    const auto slot = [&light, r](size_t path) -> Image<double>& {
      return light.paths[path].electrons[static_cast<size_t>(r)];
    };
    auto direct = renderer.Render(r, {}, /*layers=*/true);
    if (!direct.ok()) return direct.status();
    const Image<double> dark(direct->image.mean_photo_electrons.columns_px,
                             direct->image.mean_photo_electrons.rows_px, 0.0);
    for (LightPath& path : light.paths) path.electrons[static_cast<size_t>(r)] = dark;
    light.paths[laser].diffracted_electrons.push_back(dark);
    light.surfaces.push_back({direct->layers->material, direct->layers->depth_m});
    for (const size_t path : {offset, offset_error}) {
      for (double& value : slot(path).values) value = 1;
    }
    if (!open) return absl::OkStatus();
    const Image<double>& straight = direct->image.mean_photo_electrons;
    Image<double> described = straight;  // laser light of the null model
    const Image<float>* radiance = &direct->layers->laser_radiance_w_m2_sr;
    absl::StatusOr<RenderedPartFrame> reflected = absl::UnknownError("not rendered");
    if (recorded.kind == RecordingKind::kLaser) {
      reflected = renderer.Render(
          r,
          {.interreflection = true,
           .max_bounces = all_laser_light ? render.max_bounces : settings.max_bounces},
          all_laser_light);
      if (!reflected.ok()) return reflected.status();
      if (all_laser_light) {
        described = reflected->image.mean_photo_electrons;
        radiance = &reflected->layers->laser_radiance_w_m2_sr;
      } else {
        slot(*interreflection) = Difference(reflected->image.mean_photo_electrons, straight, 1);
      }
      for (size_t i = 0; i < stray.size(); ++i) {
        auto wide = renderer.Render(r, {.stray_width_m = kStrayWidths_m[i]}, false);
        if (!wide.ok()) return wide.status();
        slot(stray[i]) = Difference(wide->image.mean_photo_electrons, straight, 1);
      }
      for (size_t i = 0; i < glare.size(); ++i) {
        auto halo = renderer.Render(r, {.halo_radius_m = kHaloRadii_m[i]}, false);
        if (!halo.ok()) return halo.status();
        slot(glare[i]) = Difference(halo->image.mean_photo_electrons, straight, 1 / kGlare);
      }
    }
    light.paths[laser].diffracted_electrons[static_cast<size_t>(r)] =
        FromAfar(described, *radiance);
    slot(laser) = std::move(described);
    auto all_around = renderer.Render(
        r, {.laser = false, .max_bounces = settings.max_bounces, .surround_radiance_w_m2_sr = 1},
        false);
    if (!all_around.ok()) return all_around.status();
    slot(surround) = std::move(all_around->image.mean_photo_electrons);
    if (!lamps) return absl::OkStatus();
    auto lit = renderer.Render(
        r, {.laser = false, .lamps = true, .max_bounces = render.max_bounces}, false);
    if (!lit.ok()) return lit.status();
    if (lamp_interreflection) {
      auto more = renderer.Render(
          r, {.laser = false, .lamps = true, .max_bounces = settings.max_bounces}, false);
      if (!more.ok()) return more.status();
      slot(*lamp_interreflection) =
          Difference(more->image.mean_photo_electrons, lit->image.mean_photo_electrons, 1);
    }
    slot(*lamp) = std::move(lit->image.mean_photo_electrons);
    return absl::OkStatus();
  };
  bool laser_traced = false;
  for (int r = 0; r < recordings; ++r) {
    const absl::Status status = trace(r);
    if (absl::IsCancelled(status) && laser_traced) {
      KeepFirst(static_cast<size_t>(r), &light);
      break;
    }
    if (!status.ok()) return status;
    const RecordedImage& recorded = scene.recordings.recordings[static_cast<size_t>(r)];
    laser_traced = laser_traced || recorded.kind == RecordingKind::kLaser;
  }
  return light;
}

}  // namespace sightline
