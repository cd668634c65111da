// SPDX-License-Identifier: Apache-2.0
// Light transport in a part's scene by ray casting with Embree: laser and other light separately.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/part/mesh.h"
#include "core/rig/scan_geometry.h"
#include "render_worker/frame/ideal_image.h"
#include "render_worker/material/material.h"
#include "render_worker/spectrum/spectrum.h"

namespace sightline {

// A rectangle that emits uniformly on the side of u x v (part coordinates).
struct EmittingRectangle {
  Eigen::Vector3d centre_m;
  Eigen::Vector3d half_edge_u_m;
  Eigen::Vector3d half_edge_v_m;
  Spectrum radiance_w_m2_sr;  // per bin
};

// A mesh with the material of every triangle (index into SceneDescription::materials).
struct SceneMesh {
  TriangleMesh mesh;                        // part coordinates
  std::vector<uint16_t> triangle_material;  // empty: material 0 everywhere
};

struct SceneDescription {
  std::vector<SceneMesh> meshes;
  std::vector<std::shared_ptr<const Material>> materials;
  std::vector<EmittingRectangle> area_lights;
  Spectrum ambient_radiance_w_m2_sr = {};  // per bin, the same from everywhere
};

// Camera and laser in part coordinates at one time.
struct SceneView {
  SensorPose camera;
  SensorPose laser;  // z: the fan's centre; x: along the line; the sheet contains x and z
  double image_distance_m = 0;  // of the chief rays: u = b x/z
  double focus_distance_m = 0;
  double pupil_radius_m = 0;  // 0: pinhole
  // For a tilted sensor: change of its image distance along u and v (core/rig/scheimpflug.h), which
  // tilts the focused plane.
  double sensor_slope_u = 0, sensor_slope_v = 0;
  Distortion distortion;
  Laser laser_source;
};

struct TransportSettings {
  int max_bounces = 4;  // reflections after the first; 0: direct light only
  bool laser_interreflection = true;
  // Target standard error of a pixel, bias of the filter included, within the sample limits.
  // Incoherent light: relative to the pixel's radiance (or to a quarter of the image's mean, if
  // darker). Reflected laser light: relative to its mean, or to 1e-4 of the lit line.
  double noise_target_relative = 0.01;
  double laser_noise_target_relative = 0.05;
  // Power of two; the noise target may add more. A quarter of it for filtered light.
  int first_samples_per_px = 16;
  int max_samples_per_px = 512;
  int laser_max_samples_per_px = 128;  // of reflected light, which has low spatial frequencies
  // Smooth slowly varying light (ambient, interreflection) within surfaces (feature_filter.h).
  // Direct light of lamps and laser is never smoothed. False: every pixel alone is sampled to the
  // target.
  bool filter = true;
  int laser_light_paths = 65536;
  uint64_t seed = 1;
  int threads = 2;
};

// Images at the sub-pixels of a grid.
struct LaserTransport {
  Image<float> radiance_w_m2_sr;  // towards the centre of the pupil, laser light in its own line
  Image<float> depth_m;           // along the optical axis; 0: nothing hit
  Image<uint16_t> material;       // 0xffff: nothing hit
  Image<float> indirect_radiance_w_m2_sr;  // part of radiance_w_m2_sr after a reflection
  int64_t rays = 0;
};

// Per channel: sum over bins of radiance times weight.
struct IncoherentTransport {
  std::vector<Image<float>> channel_radiance;  // [weight unit * W/(m^2 sr)]
  Image<float> radiance_w_m2_sr;
  Image<float> standard_error_w_m2_sr;  // of radiance, estimated
  int64_t rays = 0;
};

// Gets the fraction done, from one thread at a time; cancelled() ends the work within 100 ms.
struct TransportProgress {
  std::function<void(double)> report;
  const std::atomic<bool>* cancelled = nullptr;
};

// Embree scene, materials and lights. Immutable, hence thread-safe.
class LightTransport {
 public:
  // INVALID_ARGUMENT: material index out of range, no triangles; RESOURCE_EXHAUSTED: Embree ran out
  // of memory.
  static absl::StatusOr<std::unique_ptr<LightTransport>> Make(SceneDescription description);
  virtual ~LightTransport() = default;

  // Direct light has a closed form at the hit point (mean of the beam's profile over the
  // sub-pixel's footprint, one shadow ray). Reflected light connects camera paths to vertices of
  // light paths from the laser (bidirectional, multiple importance sampling). CANCELLED.
  virtual absl::StatusOr<LaserTransport> TraceLaser(const SceneView& view, const SubPixelGrid& grid,
                                                    const TransportSettings& settings,
                                                    const TransportProgress& progress) const = 0;

  // Ambient and area lights: path tracing with next-event estimation and multiple importance
  // sampling over the pupil, adaptive to the noise target. CANCELLED.
  virtual absl::StatusOr<IncoherentTransport> TraceIncoherent(
      const SceneView& view, const SubPixelGrid& grid, const std::vector<Spectrum>& channel_weights,
      const TransportSettings& settings, const TransportProgress& progress) const = 0;
};

}  // namespace sightline
