// SPDX-License-Identifier: Apache-2.0
// Light of one frame before any lens. It is independent of f-number, focus and exposure, so it is
// traced once for all settings.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/laser_line/line_quality.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/render/part_scene.h"

namespace sightline {

// Viewing geometry of a point of the line.
struct LineView {
  double distance_m = 0;     // from the pupil's centre
  double incidence_rad = 0;  // between the surface's normal and the direction to the pupil
};

struct FrameLight {
  PartFrameRequest request;
  // Laser light seen through a pinhole at the pupil's centre, at the sub-pixels of a grid that
  // resolves the line's profile.
  SubPixelGrid grid;
  Image<float> laser_radiance_w_m2_sr;
  Image<float> depth_m;  // along the optical axis; without a hit, that of the nearest surface
  double laser_power_w = 0;
  // Other light, also through a pinhole, averaged over pixels.
  SubPixelGrid incoherent_grid;
  std::vector<Image<float>>
      channel_radiance;  // per channel, [electrons/J W/(m^2 sr)]; may be empty
  std::array<double, 3> incoherent_wavelength_m = {550e-9, 550e-9, 550e-9};
  double chief_distance_m = 0;  // image distance of the chief rays, for cos^4
  // The true line: intersection of the middle of the laser sheet with the visible lit surface, at
  // the centres of the image columns (thesis 6.4.2, the reference by rasterization: direct light,
  // no roughness, no optics). Column and row count from the region's first pixel.
  std::vector<LineCrossing> line;
  std::vector<LineView> line_views;  // one per crossing
  double median_line_depth_m = 0;
  // Radiance of the line, averaged over a pixel around a crossing: median, 10th and 90th percentile
  // over the crossings.
  double median_line_radiance_w_m2_sr = 0;
  double dim_line_radiance_w_m2_sr = 0, bright_line_radiance_w_m2_sr = 0;
  // The laser sheet in camera coordinates (z along the optical axis): normal . x = offset.
  Eigen::Vector3d sheet_normal = Eigen::Vector3d::UnitY();
  double sheet_offset_m = 0;
};

struct FrameLightOptions {
  int margin_px = 32;                   // of the laser grid and, up to 64, of the incoherent grid
  std::optional<RegionOfInterest> roi;  // of the frame; unset: the whole frame
  RenderLimits limits;
};

// `effects` change the frame's geometry and light source. The progress callback of the limits is
// called while light is traced, by one thread at a time. FAILED_PRECONDITION, reason NO_LINE: the
// laser lights nothing that is visible to the camera. CANCELLED.
absl::StatusOr<FrameLight> TraceFrameLight(PartScene& scene, const PartFrameRequest& request,
                                           std::span<const ActiveEffect> effects,
                                           const FrameLightOptions& options);

// Region of the frame around the laser line, and its statistics, by a coarse evaluation (direct
// light at every eighth pixel), cheap enough for every frame of a scan.
struct FrameGlance {
  int lit_samples = 0;                // samples on the line; 0: the laser lights nothing
  double mean_log_radiance = 0;       // natural logarithm, [W/(m^2 sr)], over lit samples
  double deviation_log_radiance = 0;  // standard deviation
  double mean_depth_m = 0;
  double deviation_depth_m = 0;
  double nearest_m = 0, farthest_m = 0;  // depth of lit samples
  RegionOfInterest roi;                  // around the lit samples, with even edges
};
absl::StatusOr<FrameGlance> GlanceAtFrame(PartScene& scene, const PartFrameRequest& request,
                                          std::span<const ActiveEffect> effects, int margin_px,
                                          const RenderLimits& limits);

// Finds the true line from the depths at the sub-pixels and from the direct laser light, which
// shows where the sheet arrives. Exposed for tests.
std::vector<LineCrossing> FindTrueLine(const SceneView& view, const SubPixelGrid& grid,
                                       const LaserTransport& laser);

}  // namespace sightline
