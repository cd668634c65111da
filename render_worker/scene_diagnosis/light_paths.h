// SPDX-License-Identifier: Apache-2.0
// The expected image taken apart by the way the light came: each part rendered once by light
// transport and optics, without speckle and noise. Recorded light is a sum of these with unknown
// factors.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// Light that is (part of) the null model, or that may have been left out of it.
struct LightPath {
  std::string effect = {};  // "illumination.interreflection"; of the null model: name of its factor
  std::string stage = {};   // "illumination", "optics", "sensor"
  std::string words = {};   // what it is, for people
  // Name of the factor with its unit, and the prior of the factor: normal, cut at 0.
  std::string parameter = {};
  double prior_mean = 0, prior_standard_deviation = 1;
  bool laser_light = false;  // has speckle
  bool nominal = false;      // in the null model
  bool may_be_negative = false;
  // Mean electrons of every recording at factor 1 [electrons].
  std::vector<Image<double>> electrons = {};
  // Part of it that diffraction brought from more than two pixels away; empty: none. Its speckle
  // is streaks, long in the direction it came from.
  std::vector<Image<double>> diffracted_electrons = {};
  // Shape that is given, not fitted, e.g. the radius of a halo; empty name: none. Between the
  // geometric means with the next smaller and larger shapes that are tried it is nearest.
  std::string shape_name = {};
  double shape = 0, shape_lower = 0, shape_upper = 0;
};

// Ids of all that may have been left out.
const std::vector<std::string>& LeftOutEffects();

// What the camera sees, per recording and pixel.
struct SeenSurface {
  Image<float> material;  // index into inspection.materials; -1: nothing hit
  Image<float> depth_m;   // along the optical axis; 0: nothing hit
};

// Of the recordings that were traced, which are the first ones.
struct SceneLight {
  std::vector<LightPath> paths;  // those of the null model first
  std::vector<SeenSurface> surfaces;
};

struct LightPathSettings {
  uint64_t seed = 1;
  int threads = 2;
  int max_bounces = 4;  // of light that is not in the null model
  int64_t max_image_bytes = int64_t{8} << 30;
  const std::atomic<bool>* cancelled = nullptr;
  std::function<void(double fraction)> progress;
};

// Null model: light straight from the laser (all of it, if the inspection has interreflection),
// lamps as described, dark charge. Left out, if they are not in the null model: laser light after
// one and more reflections between surfaces, the same of lamps, uniform light from all around, the
// laser's own stray light beside the line, veiling glare of three radii, an offset.
// Cancelled after the first recording: of those that were traced by then, a laser's among them.
// Errors as RenderPartFrame.
absl::StatusOr<SceneLight> TraceLightPaths(const RecordedScene& scene,
                                           const LightPathSettings& settings);

}  // namespace sightline
