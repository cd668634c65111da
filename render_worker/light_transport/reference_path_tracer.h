// SPDX-License-Identifier: Apache-2.0
// A simple path tracer as the reference for tests and benchmarks.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "render_worker/light_transport/light_transport.h"
#include "render_worker/light_transport/scene.h"

namespace sightline {

struct PlainSettings {
  int samples_per_px = 64;
  int max_bounces = 4;  // as in TransportSettings
  uint64_t seed = 1;
  int threads = 1;
};

struct PlainImage {
  Image<float> mean;
  Image<float> standard_error;
  int64_t rays = 0;
};

// Next-event estimation and multiple importance sampling (balance heuristic) with independent
// random samples, without reuse between pixels or low-discrepancy points. The samples of a
// sub-pixel of the grid cover it uniformly.
class PlainPathTracer {
 public:
  // `scene` must outlive this.
  explicit PlainPathTracer(const RayScene& scene) : scene_(scene) {}

  // Lamps and ambient, sum over bins of radiance times weight; over the pupil.
  PlainImage TraceIncoherent(const SceneView& view, const SubPixelGrid& grid,
                             const Spectrum& weight, const PlainSettings& settings) const;
  // Laser light through a pinhole. Its irradiance at every path vertex has a closed form (no path
  // hits a light source without area by chance); further reflections use BRDF sampling only.
  PlainImage TraceLaser(const SceneView& view, const SubPixelGrid& grid,
                        const PlainSettings& settings) const;
  // The same without direct laser light.
  PlainImage TraceLaserIndirect(const SceneView& view, const SubPixelGrid& grid,
                                const PlainSettings& settings) const;

 private:
  const RayScene& scene_;
};

}  // namespace sightline
