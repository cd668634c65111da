// SPDX-License-Identifier: Apache-2.0
// Points that laser light reaches directly or after reflections: end points for camera paths.
#pragma once

#include <vector>

#include "render_worker/light_transport/laser/laser_beam.h"
#include "render_worker/light_transport/scene.h"

namespace sightline {

// Camera paths y_1 (seen by the camera), y_2, ... are connected to light paths x_1 (on the lit
// line), x_2, ... A path of n reflections can arise in n ways: s = 0..n-1 vertices come from the
// laser, the rest from the camera. s = 0 means that a camera path hits the lit line by chance,
// where the irradiance has a closed form. The ways are combined by the balance heuristic (Veach
// 1997, chapter 10) as if each way with s >= 1 made kConnectionsPerVertex connections. Any fixed
// number gives the right mean; this one is near the actual number. Densities are per area; the
// running sums are those of Georgiev et al. 2012 (vertex connection).
inline constexpr float kConnectionsPerVertex = 4;

struct LightVertex {
  SurfacePoint point;
  Eigen::Vector3f towards_light;  // local direction towards the light's origin
  float flux_w = 0;               // carried by the path, before reflection here
  float density = 0;              // of this vertex in the light path [1/m^2]
  // Previous vertex: its density, cosine over distance squared towards this one, running sum.
  float previous_density = 0;
  float previous_geometry = 0;
  float previous_sum = 0;
};

class LightVertices {
 public:
  // Traces light paths that start in proportion to the beam's power, evenly spread over fan and
  // profile, with up to `max_reflections` vertices each.
  LightVertices(const RayScene& scene, const LaserBeam& beam, int paths, int max_reflections,
                uint64_t seed);

  int paths() const { return paths_; }
  // Vertices after s - 1 reflections, s = 1..max_reflections, in the order of the fan.
  const std::vector<LightVertex>& AtDepth(int s) const { return vertices_[s - 1]; }
  // Data for a first pass over many vertices, contiguous in memory.
  struct Summary {
    Eigen::Vector3f position_m;
    Eigen::Vector3f normal;
    float flux_w;
    float density;
  };
  const std::vector<Summary>& SummariesAtDepth(int s) const { return summaries_[s - 1]; }
  int max_depth() const { return static_cast<int>(vertices_.size()); }

 private:
  int paths_;
  std::vector<std::vector<LightVertex>> vertices_;
  std::vector<std::vector<Summary>> summaries_;
};

// Irradiance of a surface point by direct laser light [W/m^2]; 0 in shadow. `in`: local direction
// to the source.
float LaserIrradiance(const RayScene& scene, const LaserBeam& beam, const SurfacePoint& point,
                      Eigen::Vector3f& in, int& rays);

}  // namespace sightline
