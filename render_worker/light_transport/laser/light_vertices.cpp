// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/laser/light_vertices.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/light_transport/sampling.h"

namespace sightline {
namespace {

double StandardNormal(float u1, float u2) {
  return std::sqrt(-2 * std::log(1.0 - u1)) * std::cos(2 * std::numbers::pi * u2);
}

}  // namespace

float LaserIrradiance(const RayScene& scene, const LaserBeam& beam, const SurfacePoint& point,
                      Eigen::Vector3f& in, int& rays) {
  const auto c = beam.CoordinatesOf(point.position_m.cast<double>());
  if (!beam.Reaches(c, kBeamWidths)) return 0;
  in = point.ToLocal(-beam.Direction(c).cast<float>());
  if (in.z() <= 0) return 0;
  ++rays;
  if (!scene.Visible(point, beam.SourcePoint(c).cast<float>())) return 0;
  return static_cast<float>(beam.Irradiance_w_m2(c)) * in.z();
}

LightVertices::LightVertices(const RayScene& scene, const LaserBeam& beam, int paths,
                             int max_reflections, uint64_t seed)
    : paths_(paths), vertices_(max_reflections), summaries_(max_reflections) {
  for (int i = 0; i < paths; ++i) {
    PixelSamples samples(seed, i & 255, i >> 8, 0);
    samples.Start(0);
    const auto u = samples.Next();
    const double t = beam.SampleT((i + double{u[0]}) / paths);
    const double s = 0.5 * StandardNormal(u[1], u[2]);  // q = s w
    // The place across the sheet depends on the distance: first along the middle of the sheet, then
    // to the point itself.
    LightVertex vertex;
    SurfacePoint hit;
    double z_m = 1;
    bool met = true;
    for (int pass = 0; pass < 3 && met; ++pass) {
      const double at = pass == 0 ? 0 : s;
      const LaserBeam::Coordinates aim = {t, at * beam.Radius_m(z_m), z_m};
      const Eigen::Vector3d origin = beam.SourcePoint(aim);
      const Eigen::Vector3d direction = beam.PointAt(t, at, z_m) - origin;
      met = scene.Intersect(origin.cast<float>(), direction.cast<float>(), 0, 0, hit);
      z_m *= hit.distance;
    }
    if (!met || hit.lamp >= 0) continue;
    vertex.point = hit;
    const auto c = beam.CoordinatesOf(hit.position_m.cast<double>());
    vertex.towards_light = hit.ToLocal(-beam.Direction(c).cast<float>());
    if (vertex.towards_light.z() <= 0) continue;
    vertex.flux_w = static_cast<float>(beam.power_w());
    vertex.density =
        static_cast<float>(beam.Irradiance_w_m2(c) / beam.power_w()) * vertex.towards_light.z();
    float sum = 1;  // of ways with fewer vertices from the laser, relative
    for (int depth = 1;; ++depth) {
      vertices_[depth - 1].push_back(vertex);
      summaries_[depth - 1].push_back(
          {vertex.point.position_m, vertex.point.normal, vertex.flux_w, vertex.density});
      if (depth >= max_reflections) break;
      const auto v = samples.Next();
      const SurfacePoint& from = vertex.point;
      const Material::Sample sample =
          from.material->SampleDirection(vertex.towards_light, from.detail, v[0], v[1], v[2]);
      if (!(sample.pdf > 0) || sample.in.z() <= 0) break;
      const float scale = from.material->Brdf(sample.in, vertex.towards_light, from.detail) *
                          sample.in.z() / sample.pdf;
      const float survival = std::min(scale, 1.0F);
      if (!(v[3] < survival)) break;
      LightVertex next;
      const Eigen::Vector3f direction = from.ToWorld(sample.in);
      if (!scene.IntersectFrom(from, direction, next.point) || next.point.lamp >= 0) break;
      if (depth >= 2) {
        // Density with which a camera path coming from `next` would go on to the vertex before.
        const float reverse = from.material->Pdf(sample.in, vertex.towards_light, from.detail) *
                              vertex.previous_geometry;
        sum = kConnectionsPerVertex + reverse / vertex.previous_density * vertex.previous_sum;
      }
      next.towards_light = next.point.ToLocal(-direction);
      const float inverse_square = 1 / (next.point.distance * next.point.distance);
      next.flux_w = vertex.flux_w * scale / survival;
      next.density = sample.pdf * next.towards_light.z() * inverse_square;
      next.previous_density = vertex.density;
      next.previous_geometry = sample.in.z() * inverse_square;
      next.previous_sum = sum;
      vertex = next;
    }
  }
}

}  // namespace sightline
