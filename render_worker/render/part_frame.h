// SPDX-License-Identifier: Apache-2.0
// Renders one image of a part: light transport, ideal image, optics, sensor.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/render/part_scene.h"

namespace sightline {

// Layers of an image, at the pixels of the region of interest.
struct FrameLayers {
  Image<float> laser_radiance_w_m2_sr;       // mean over the pixel
  Image<float> depth_m;                      // along the optical axis; 0: nothing hit
  Image<float> material;                     // index; -1: nothing hit
  Image<float> incoherent_radiance_w_m2_sr;  // empty: no other light
  Image<float> laser_irradiance_w_m2;        // after optics
  Image<float> photo_electrons;              // mean, before noise
};

// Settings of camera and laser that replace the inspection's.
struct CameraSetting {
  double f_number = 0;
  double exposure_time_s = 0;
  double focus_distance_m = 0;
  double laser_power_w = 0;
  double sensor_tilt_x_rad = 0, sensor_tilt_y_rad = 0;
};

struct PartFrameRequest {
  Measurement measurement;
  double stage_position_m = 0;
  std::optional<CameraSetting> setting = std::nullopt;
};

struct RenderLimits {
  int threads = 1;
  int64_t max_image_bytes = int64_t{8} << 30;
  const std::atomic<bool>* cancelled = nullptr;
  std::function<void(double fraction)> progress;  // may be empty
};

struct RenderedPartFrame {
  FormedImage image;
  std::optional<FrameLayers> layers;
  std::vector<std::string> warnings;
};

// The frame's setup without effects. A surface at the same position has the same speckle; noise
// differs for every measurement and stage position.
FrameSetup PartFrameSetup(const Inspection& inspection, const PartFrameRequest& request);

// `effects`: those of the inspection. INVALID_ARGUMENT: an effect for plates only;
// RESOURCE_EXHAUSTED: more memory than the limit; CANCELLED.
absl::StatusOr<RenderedPartFrame> RenderPartFrame(PartScene& scene, const PartFrameRequest& request,
                                                  std::span<const ActiveEffect> effects,
                                                  bool layers, const RenderLimits& limits);

}  // namespace sightline
