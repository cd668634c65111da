// SPDX-License-Identifier: Apache-2.0
// Rendered pictures of a scene as PNG.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "coverage_server/scene/coverage_scene.h"

namespace sightline {

enum class ViewKind { kFree, kCamera, kCoverage, kMeasurability };

struct ViewRequest {
  ViewKind kind = ViewKind::kFree;
  // kFree: drawn with camera, laser fan and world axes. kCamera (required): its camera's picture.
  std::optional<Measurement> measurement;
  double stage_m = 0;
  // Viewing direction of kFree, kCoverage, kMeasurability; kFree with a measurement: world frame.
  double azimuth_rad = 0.6;
  double elevation_rad = 0.5;
  double distance_m = 0;  // 0: all fits
  int columns_px = 800;   // [16, 4096]
  int rows_px = 600;
  // kCoverage: targets covered so far.
  TargetBits covered;
};

// PNG bytes. INVALID_ARGUMENT for an impossible size or a missing measurement.
absl::StatusOr<std::string> RenderView(const CoverageScene& scene, const ViewRequest& request);

}  // namespace sightline
