// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/uncertainty/surface_extent.h"

#include <algorithm>
#include <cmath>

#include "core/part/surface_geometry.h"
#include "core/surface_inference/surface_inference.h"

namespace sightline {
namespace {

// Ratio of point spacing to length scale: half of the spacing at which the surface between points
// becomes uncertain, see SamplingVariance.
constexpr double kSpacingRelative = 0.25;

// A triangle seen along the target's normal, in its tangent plane.
struct Flat {
  std::array<Eigen::Vector2f, 3> corners;
  float sign;  // of its area

  bool Contains(const Eigen::Vector2f& p) const {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2f edge = corners[(k + 1) % 3] - corners[k], to = p - corners[k];
      if (sign * (edge.x() * to.y() - edge.y() * to.x()) < 0) return false;
    }
    return true;
  }
};

}  // namespace

void ComputeExtentCosts(const TriangleMesh& mesh, const TriangleBvh& bvh, const TargetSet& targets,
                        const TargetPriors& priors, double max_normal_angle_rad, size_t begin,
                        size_t end, std::span<ExtentCost> costs,
                        const std::atomic<bool>* cancelled) {
  const double cos_gate = std::cos(max_normal_angle_rad);
  std::vector<LocalSurface> surfaces;
  for (const SurfacePrior& prior : priors.priors) surfaces.emplace_back(prior);
  std::vector<Flat> nearby;
  std::vector<SurfaceObservation> points;
  for (size_t t = begin; t < end; ++t) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return;
    const SurfacePrior& prior = priors.of(t);
    const Eigen::Vector3f& centre = targets.positions_m[t];
    const Eigen::Vector3f& normal = targets.normals[t];
    const auto axes = TangentAxes(normal);
    const auto radius = static_cast<float>(prior.neighbourhood_m());
    nearby.clear();
    bvh.VisitBox(
        {Eigen::Vector3f(centre.array() - radius), Eigen::Vector3f(centre.array() + radius)},
        [&](uint32_t triangle) {
          if (mesh.Normal(triangle).dot(normal.cast<double>()) < cos_gate) return;
          Flat flat;
          for (int k = 0; k < 3; ++k) {
            const Eigen::Vector3f d = mesh.positions_m[mesh.triangles[triangle][k]] - centre;
            flat.corners[k] = {d.dot(axes[0]), d.dot(axes[1])};
          }
          const Eigen::Vector2f a = flat.corners[1] - flat.corners[0],
                                b = flat.corners[2] - flat.corners[0];
          flat.sign = a.x() * b.y() - a.y() * b.x() < 0 ? -1.0f : 1.0f;
          nearby.push_back(flat);
        });
    points.clear();
    const double spacing_m = kSpacingRelative * prior.length_scale_m;
    const int reach = static_cast<int>(prior.neighbourhood_m() / spacing_m);
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        // The grid is shifted by a third of a spacing: points of a scan do not lie on the target.
        const Eigen::Vector2d place((i + 1.0 / 3) * spacing_m, (j + 1.0 / 3) * spacing_m);
        if (place.squaredNorm() > prior.neighbourhood_m() * prior.neighbourhood_m()) continue;
        const Eigen::Vector2f p = place.cast<float>();
        if (std::any_of(nearby.begin(), nearby.end(),
                        [&](const Flat& flat) { return flat.Contains(p); })) {
          points.push_back({place, 0});
        }
      }
    }
    for (size_t level = 0; level < kExtentLevels.size(); ++level) {
      const double endless_m = kExtentLevels[level] * prior.standard_deviation_m;
      const double density = DensityForUncertainty(prior, endless_m);
      for (SurfaceObservation& point : points) {
        point.noise_variance_m2 = 1 / (density * spacing_m * spacing_m);
      }
      LocalSurface& surface = surfaces[priors.prior_of[t]];
      surface.Clear();
      surface.AddScan(points, 0);
      costs[t][level] =
          static_cast<float>(std::max(0.0, std::log(surface.Uncertainty().total_m / endless_m)));
    }
  }
}

}  // namespace sightline
