// SPDX-License-Identifier: Apache-2.0
// Laser light that is reflected before it reaches a surface visible to the camera.
#pragma once

#include "render_worker/light_transport/laser/light_vertices.h"
#include "render_worker/light_transport/sampling.h"

namespace sightline {

class Interreflection {
 public:
  // The arguments must outlive this.
  Interreflection(const RayScene& scene, const LaserBeam& beam, const LightVertices& vertices,
                  int max_bounces)
      : scene_(scene), beam_(beam), vertices_(vertices), max_bounces_(max_bounces) {}

  struct Estimate {
    float radiance_w_m2_sr = 0;
    // Mean over the sources that light the first surface, weighted by their light.
    float inverse_distance_1_m = 0;
    int rays = 0;
  };
  // One unbiased sample of the radiance from `first` against `direction`, without direct laser
  // light.
  Estimate Sample(const SurfacePoint& first, const Eigen::Vector3f& direction,
                  PixelSamples& samples) const;

 private:
  struct CameraVertex;
  // Examines many light vertices, chooses a few roughly in proportion to their unoccluded
  // contribution (resampled importance sampling, Talbot et al. 2005) and connects these.
  // `inverse_distance`: of the vertices, weighted by their light.
  float Connect(const CameraVertex& vertex, PixelSamples& samples, int& rays,
                float& inverse_distance) const;
  // Unoccluded contribution of the vertex, with the multiple importance sampling weight of its
  // path.
  float Connection(const CameraVertex& vertex, const LightVertex& light, int light_depth) const;

  const RayScene& scene_;
  const LaserBeam& beam_;
  const LightVertices& vertices_;
  int max_bounces_;
};

}  // namespace sightline
