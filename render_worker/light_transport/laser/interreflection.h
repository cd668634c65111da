// SPDX-License-Identifier: Apache-2.0
// Laser light that was reflected before it reaches a surface the camera sees.
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
  // One unbiased sample of the radiance from `first` against `direction`, without light that comes
  // straight from the laser.
  Estimate Sample(const SurfacePoint& first, const Eigen::Vector3f& direction,
                  PixelSamples& samples) const;

 private:
  struct CameraVertex;
  // Looks at many light vertices, chooses few in proportion to about the light they would bring
  // unoccluded (resampled importance sampling, Talbot et al. 2005), connects these.
  // `inverse_distance`: of the vertices, weighted by their light.
  float Connect(const CameraVertex& vertex, PixelSamples& samples, int& rays,
                float& inverse_distance) const;
  // Light that the vertex would bring unoccluded, with its weight among the ways to have the path.
  float Connection(const CameraVertex& vertex, const LightVertex& light, int light_depth) const;

  const RayScene& scene_;
  const LaserBeam& beam_;
  const LightVertices& vertices_;
  int max_bounces_;
};

}  // namespace sightline
