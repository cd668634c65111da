// SPDX-License-Identifier: Apache-2.0
// Expected images of a part, separated by light path.
//
// A recording is modelled as a sum over light paths k, y = sum_k f_k y_k, with y_k the mean
// photo-electrons of every pixel [electrons] and f_k a factor that is fitted (fit/path_fit.h).
// Each y_k is rendered once by light transport and optics, without speckle and noise.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// Light that the null model contains, or may lack.
struct LightPath {
  // Id of the effect, from the vocabulary or from light/path_names.h; paths of the null model have
  // the name of their factor.
  std::string effect = {};
  std::string stage = {};        // "illumination", "optics", "sensor"
  std::string description = {};  // a noun phrase for reports
  // Name of the factor with its unit, and its prior: normal, truncated at 0.
  std::string parameter = {};
  double prior_mean = 0, prior_standard_deviation = 1;
  bool laser_light = false;      // coherent light, which has speckle
  bool nominal = false;          // a path of the null model
  bool may_be_negative = false;  // the prior is not truncated
  // Mean photo-electrons of every recording at factor 1 [electrons].
  std::vector<Image<double>> electrons = {};
  // The part of `electrons` diffracted from more than two pixels away; empty: none. Its speckle
  // forms streaks that point towards its origin.
  std::vector<Image<double>> diffracted_electrons = {};
  // A shape parameter that is tried at several values instead of fitted, e.g. the radius of a halo.
  // Empty name: none. The bounds are the geometric means with the neighbouring values.
  std::string shape_name = {};
  double shape = 0, shape_lower = 0, shape_upper = 0;
};

// Ids of all light paths that the null model may lack.
const std::vector<std::string>& LeftOutEffects();

// The surface that every pixel of one recording sees.
struct SeenSurface {
  Image<float> material;  // index into inspection.materials; -1: nothing hit
  Image<float> depth_m;   // along the optical axis; 0: nothing hit
};

// Light of the traced recordings, which are the first ones of the set.
struct SceneLight {
  std::vector<LightPath> paths;  // those of the null model first
  std::vector<SeenSurface> surfaces;
};

struct LightPathSettings {
  uint64_t seed = 1;
  int threads = 2;
  int max_bounces = 4;  // reflections of light that is not in the null model; >= 0
  int64_t max_image_bytes = int64_t{8} << 30;
  const std::atomic<bool>* cancelled = nullptr;
  std::function<void(double fraction)> progress;
};

// Renders every light path of every recording.
//
// Null model: direct laser light (with interreflection if the inspection's render settings include
// it), lamps as described, dark charge. Paths that the null model may lack, unless its settings
// include them: laser light after one or more reflections between surfaces, the same for lamps,
// uniform light from all directions, stray light of the projector beside the line (two widths),
// veiling glare (three radii), an offset of the sensor.
//
// If cancelled after a recording with laser light, the answer contains the completely traced
// recordings; if cancelled earlier, CANCELLED. Other errors are those of RenderPartFrame.
absl::StatusOr<SceneLight> TraceLightPaths(const RecordedScene& scene,
                                           const LightPathSettings& settings);

}  // namespace sightline
