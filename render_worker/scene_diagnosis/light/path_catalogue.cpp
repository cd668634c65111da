// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/light/path_catalogue.h"

#include <cmath>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

#include "render_worker/effects/vocabulary.h"
#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

// Prior standard deviation of a scale whose uncertainty the description does not state [1]: power,
// albedo and transmission of a rig that nobody has calibrated. An assumption.
constexpr double kUnstatedScale = 0.3;
// The same for interreflected light [1]. It is proportional to the square of the albedo, so it is
// less certain. An assumption.
constexpr double kInterreflectionScale = 0.5;
// Prior standard deviation of a dark charge whose uncertainty is not stated [electrons]. An
// assumption.
constexpr double kUnstatedOffset_electrons = 2;
// Prior standard deviations of light that the null model lacks: assumptions about a rig that was
// set up with care, wide compared with what recordings determine.
constexpr double kSurroundRadiance_w_m2_sr = 0.1;
constexpr double kStrayFraction = 0.05, kGlareFraction = 0.05;
constexpr double kSensorOffset_electrons = 20;
// Half widths of the projector's stray light beside the line [m], and radii of the halo of veiling
// glare on the sensor [m]. They are chosen a factor of four to five apart, from light close to the
// line to light over most of the image.
constexpr double kStrayWidths_m[] = {3e-3, 12e-3};
constexpr double kHaloRadii_m[] = {5e-5, 2e-4, 1e-3};

std::string IdOf(const Effect& effect) { return std::string(effect.description().id); }

// The range of shapes that are nearer to the i-th than to the others, on a logarithmic scale.
std::pair<double, double> ShapeRange(std::span<const double> shapes, size_t i) {
  const size_t last = shapes.size() - 1;
  const double below = i > 0 ? shapes[i] / shapes[i - 1] : shapes[1] / shapes[0];
  const double above = i < last ? shapes[i + 1] / shapes[i] : shapes[last] / shapes[last - 1];
  return {shapes[i] / std::sqrt(below), shapes[i] * std::sqrt(above)};
}

size_t AddPath(LightPath path, std::vector<LightPath>* paths) {
  paths->push_back(std::move(path));
  return paths->size() - 1;
}

// Adds `path` once for every shape.
std::vector<size_t> AddShapes(const LightPath& path, std::span<const double> shapes,
                              std::vector<LightPath>* paths) {
  std::vector<size_t> places;
  for (size_t i = 0; i < shapes.size(); ++i) {
    LightPath one = path;
    one.shape = shapes[i];
    std::tie(one.shape_lower, one.shape_upper) = ShapeRange(shapes, i);
    places.push_back(AddPath(std::move(one), paths));
  }
  return places;
}

void AddNullModel(const SetupDeviation& stated, bool has_lamps, PathCatalogue* catalogue) {
  // Power, transmission, albedo and quantum efficiency scale all laser light alike.
  const double stated_scale =
      std::hypot(std::hypot(stated.power_relative, stated.transmission_relative),
                 std::hypot(stated.diffuse_albedo_relative, stated.quantum_efficiency_relative));
  const double scale = stated_scale > 0 ? stated_scale : kUnstatedScale;
  catalogue->laser = AddPath({.effect = std::string(kLaserFactor),
                              .stage = "illumination",
                              .description = "laser light as described",
                              .parameter = std::string(kLaserFactor),
                              .prior_mean = 1,
                              .prior_standard_deviation = scale,
                              .laser_light = true,
                              .nominal = true},
                             &catalogue->paths);
  catalogue->dark_charge = AddPath(
      {.effect = std::string(kDarkMeanElectrons),
       .stage = "sensor",
       .description = "dark charge",
       .parameter = std::string(kDarkMeanElectrons),
       .prior_standard_deviation =
           stated.dark_mean_electrons > 0 ? stated.dark_mean_electrons : kUnstatedOffset_electrons,
       .nominal = true,
       .may_be_negative = true},
      &catalogue->paths);
  if (!has_lamps) return;
  catalogue->lamps = AddPath({.effect = std::string(kLampFactor),
                              .stage = "illumination",
                              .description = "other light as described",
                              .parameter = std::string(kLampFactor),
                              .prior_mean = 1,
                              .prior_standard_deviation = kUnstatedScale,
                              .nominal = true},
                             &catalogue->paths);
}

LightPath InterreflectionPath(std::string_view effect, std::string_view description,
                              bool laser_light) {
  return {.effect = std::string(effect),
          .stage = "illumination",
          .description = std::string(description),
          .parameter = "interreflected_light_factor",
          .prior_mean = 1,
          .prior_standard_deviation = kInterreflectionScale,
          .laser_light = laser_light};
}

// Surround light, stray light, veiling glare and an offset: a null model never has them.
void AddUndescribedLight(PathCatalogue* catalogue) {
  catalogue->surround = AddPath({.effect = IdOf(AmbientLight()),
                                 .stage = "illumination",
                                 .description = "light from all around that is not described",
                                 .parameter = "ambient_radiance_w_m2_sr",
                                 .prior_standard_deviation = kSurroundRadiance_w_m2_sr},
                                &catalogue->paths);
  catalogue->stray_light =
      AddShapes({.effect = std::string(kLaserStrayLight),
                 .stage = "illumination",
                 .description = "light that leaves the projector beside the line",
                 .parameter = "stray_fraction",
                 .prior_standard_deviation = kStrayFraction,
                 .laser_light = true,
                 .shape_name = "half_width_m"},
                kStrayWidths_m, &catalogue->paths);
  catalogue->veiling_glare = AddShapes({.effect = IdOf(VeilingGlare()),
                                        .stage = "optics",
                                        .description = "light scattered in the lens",
                                        .parameter = "glare_fraction",
                                        .prior_standard_deviation = kGlareFraction,
                                        .laser_light = true,
                                        .shape_name = "halo_radius_m"},
                                       kHaloRadii_m, &catalogue->paths);
  catalogue->sensor_offset = AddPath({.effect = IdOf(BlackLevelError()),
                                      .stage = "sensor",
                                      .description = "an offset of the sensor",
                                      .parameter = "black_level_shift_electrons",
                                      .prior_standard_deviation = kSensorOffset_electrons,
                                      .may_be_negative = true},
                                     &catalogue->paths);
}

}  // namespace

const std::vector<std::string>& LeftOutEffects() {
  static const auto& effects = *new std::vector<std::string>{
      std::string(kInterreflection), std::string(kLampInterreflection),
      IdOf(AmbientLight()),          std::string(kLaserStrayLight),
      IdOf(VeilingGlare()),          IdOf(BlackLevelError())};
  return effects;
}

bool NullModelHasInterreflection(const RenderSettings& render) {
  return render.laser_interreflection && render.max_bounces > 0;
}

PathCatalogue MakePathCatalogue(const RecordedScene& scene) {
  const RenderSettings& render = scene.inspection.render;
  const v1::Lighting& lighting = scene.inspection.lighting;
  const bool has_lamps =
      lighting.ambient().radiance_w_m2_sr() > 0 || lighting.area_lights_size() > 0;
  PathCatalogue catalogue;
  AddNullModel(scene.recordings.uncertainty, has_lamps, &catalogue);
  if (!NullModelHasInterreflection(render)) {
    catalogue.laser_interreflection =
        AddPath(InterreflectionPath(kInterreflection,
                                    "laser light reflected from one surface of the part to another",
                                    /*laser_light=*/true),
                &catalogue.paths);
  }
  if (has_lamps && render.max_bounces <= 0) {
    catalogue.lamp_interreflection = AddPath(
        InterreflectionPath(kLampInterreflection,
                            "light of lamps reflected from one surface of the part to another",
                            /*laser_light=*/false),
        &catalogue.paths);
  }
  AddUndescribedLight(&catalogue);
  return catalogue;
}

}  // namespace sightline
