#include "coverage_server/visibility/surface_probes.h"

#include <cmath>
#include <numbers>

namespace sightline {
namespace {

// Ericson, Real-Time Collision Detection, 5.1.5.
Eigen::Vector3f ClosestOnTriangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a,
                                  const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Eigen::Vector3f bp = p - b;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Eigen::Vector3f cp = p - c;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const float denominator = va + vb + vc;
  if (denominator == 0) return a;
  return a + ab * (vb / denominator) + ac * (vc / denominator);
}

}  // namespace

SurfaceProbes MakeSurfaceProbes(const TriangleMesh& mesh, const TriangleBvh& bvh,
                                const TargetSet& targets, const TargetSampling& sampling) {
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
    const Eigen::Vector3f tangent =
        normal
            .cross(std::abs(normal.x()) < 0.7f ? Eigen::Vector3f::UnitX()
                                               : Eigen::Vector3f::UnitY())
            .normalized();
    const Eigen::Vector3f bitangent = normal.cross(tangent);
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
