// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/visibility/surface_probes.h"

#include <cmath>
#include <numbers>

#include "core/part/surface_geometry.h"

namespace sightline {

SurfaceProbes MakeSurfaceProbes(const TriangleMesh& mesh, const TriangleBvh& bvh,
                                const TargetSet& targets, const TargetSampling& sampling,
                                const std::atomic<bool>* cancelled) {
  const float radius = static_cast<float>(sampling.coverage_radius_m);
  const float cos_gate = static_cast<float>(std::cos(sampling.max_normal_angle_rad));

  SurfaceProbes probes;
  probes.positions_m.resize(targets.size() * kProbesPerTarget);
  probes.normals.resize(targets.size() * kProbesPerTarget);
  struct Nearby {
    Eigen::Vector3f a, b, c, normal;
  };
  std::vector<Nearby> nearby;
  for (size_t i = 0; i < targets.size(); ++i) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return probes;
    const Eigen::Vector3f centre = targets.positions_m[i], normal = targets.normals[i];
    nearby.clear();
    bvh.VisitBox(
        {Eigen::Vector3f(centre.array() - radius), Eigen::Vector3f(centre.array() + radius)},
        [&](uint32_t t) {
          const Eigen::Vector3f n = mesh.Normal(t).cast<float>();
          if (n.dot(normal) < cos_gate) return;
          const auto& corner = mesh.triangles[t];
          nearby.push_back({mesh.positions_m[corner[0]], mesh.positions_m[corner[1]],
                            mesh.positions_m[corner[2]], n});
        });
    const auto [tangent, bitangent] = TangentAxes(normal);
    for (int k = 0; k < kProbesPerTarget; ++k) {
      const size_t slot = i * kProbesPerTarget + k;
      probes.positions_m[slot] = centre;
      probes.normals[slot] = normal;
      if (k == 0) continue;
      const float angle =
          2 * std::numbers::pi_v<float> * static_cast<float>(k - 1) / (kProbesPerTarget - 1);
      const Eigen::Vector3f wanted =
          centre +
          kProbeRadiusRelative * radius * (std::cos(angle) * tangent + std::sin(angle) * bitangent);
      float best = radius;  // a probe may slide this far to stay on the surface
      for (const Nearby& triangle : nearby) {
        const Eigen::Vector3f p = ClosestOnTriangle(wanted, triangle.a, triangle.b, triangle.c);
        const float distance = (p - wanted).norm();
        if (distance < best && (p - centre).squaredNorm() <= radius * radius) {
          best = distance;
          probes.positions_m[slot] = p;
          probes.normals[slot] = triangle.normal;
        }
      }
    }
  }
  return probes;
}

}  // namespace sightline
