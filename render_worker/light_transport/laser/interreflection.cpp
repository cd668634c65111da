// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/laser/interreflection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

// Light vertices examined per camera vertex: on the line, after one reflection, after more.
constexpr int kCandidates[3] = {32, 16, 8};
constexpr int kMaxCandidates = 128;
// Connections made from the first camera vertex, from later ones.
constexpr int kConnections[2] = {2, 1};

}  // namespace

// The end of a camera path. Densities are per area.
struct Interreflection::CameraVertex {
  SurfacePoint point;
  Eigen::Vector3f out;          // local direction to the camera or the vertex before
  int depth = 1;                // reflections so far, this one included
  float density = 0;            // from depth 2 on
  float previous_density = 0;   // from depth 3 on
  float previous_geometry = 0;  // cosine at the vertex before over distance squared
  float previous_sum = 0;       // running sum of ways with more vertices from the laser

  // Sum over the ways with more vertices from the laser, relative to the present one, if this
  // vertex has the density `light_density` as part of the light path and its light comes from `in`.
  float WaysFromLight(float light_density, const Eigen::Vector3f& in) const {
    if (depth < 2) return 0;
    float sum = kConnectionsPerVertex;
    if (depth >= 3) sum += PreviousRatio(in) * previous_sum;
    return light_density / density * sum;
  }
  // Density of the vertex before as continuation of a light path, over its own.
  float PreviousRatio(const Eigen::Vector3f& in) const {
    return point.material->Pdf(in, out, point.detail) * previous_geometry / previous_density;
  }
};

float Interreflection::Connection(const CameraVertex& vertex, const LightVertex& x,
                                  int light_depth) const {
  const SurfacePoint& y = vertex.point;
  const Eigen::Vector3f to = x.point.position_m - y.position_m;
  const float square = to.squaredNorm();
  const Eigen::Vector3f direction = to / std::sqrt(square);
  const Eigen::Vector3f in = y.ToLocal(direction), back = x.point.ToLocal(-direction);
  if (in.z() <= 0 || back.z() <= 0) return 0;
  const float f_y = y.material->Brdf(vertex.out, in, y.detail);
  const float f_x = x.point.material->Brdf(back, x.towards_light, x.point.detail);
  if (!(f_y > 0) || !(f_x > 0)) return 0;
  // Ways with fewer vertices from the laser: the camera path goes on to x, and further.
  float fewer = 1;
  if (light_depth >= 2) {
    const float onwards =
        x.point.material->Pdf(back, x.towards_light, x.point.detail) * x.previous_geometry;
    fewer = kConnectionsPerVertex + onwards / x.previous_density * x.previous_sum;
  }
  fewer *= y.material->Pdf(vertex.out, in, y.detail) * back.z() / square / x.density;
  const float light_density =
      x.point.material->Pdf(x.towards_light, back, x.point.detail) * in.z() / square;
  const float more = vertex.WaysFromLight(light_density, in);
  const float weight = kConnectionsPerVertex / (kConnectionsPerVertex + fewer + more);
  return weight * f_y * f_x * in.z() * back.z() / square * x.flux_w;
}

float Interreflection::Connect(const CameraVertex& vertex, PixelSamples& samples, int& rays,
                               float& inverse_distance) const {
  struct Candidate {
    const LightVertex* light;
    int depth;
    float scale;
    float promise;  // about what it would bring
  };
  std::array<Candidate, kMaxCandidates> candidates;
  int count = 0;
  float total = 0;
  const auto u = samples.Next();
  const SurfacePoint& y = vertex.point;
  // At least one reflection is left for the light path.
  const int deepest = std::min(max_bounces_ + 1 - vertex.depth, vertices_.max_depth());
  for (int s = 1; s <= deepest; ++s) {
    const std::vector<LightVertices::Summary>& pool = vertices_.SummariesAtDepth(s);
    const auto size = static_cast<int>(pool.size());
    const int picks = kCandidates[std::min(s, 3) - 1] / (vertex.depth == 1 ? 1 : 2);
    if (size == 0 || count + picks > kMaxCandidates) continue;
    // The picks are spread over the fan; every depth is shifted by itself.
    float shift = (s & 1) != 0 ? u[0] : u[1];
    shift += 0.618034F * static_cast<float>(s >> 1);
    shift -= std::floor(shift);
    const float step = static_cast<float>(size) / static_cast<float>(picks);
    const float scale = step / static_cast<float>(vertices_.paths());
    for (int k = 0; k < picks; ++k) {
      const int index =
          std::min(static_cast<int>((static_cast<float>(k) + shift) * step), size - 1);
      const LightVertices::Summary& x = pool[index];
      const Eigen::Vector3f to = x.position_m - y.position_m;
      const float cosine_y = y.normal.dot(to), cosine_x = -x.normal.dot(to);
      if (cosine_y <= 0 || cosine_x <= 0) continue;
      const float square = to.squaredNorm();
      const float geometry = cosine_y * cosine_x / (square * square);
      // With about the weight of diffuse surfaces.
      const float share = kConnectionsPerVertex * x.density;
      const float promise =
          scale * x.flux_w * geometry * share / (share + geometry * std::numbers::inv_pi_v<float>);
      candidates[count++] = {&vertices_.AtDepth(s)[index], s, scale, promise};
      total += promise;
    }
  }
  if (!(total > 0)) return 0;
  const int connections = kConnections[vertex.depth == 1 ? 0 : 1];
  const float step = total / static_cast<float>(connections);
  float light = 0, distances = 0, below = 0;
  int at = 0;
  for (int k = 0; k < connections; ++k) {
    const float target = (static_cast<float>(k) + u[2]) * step;
    while (at < count - 1 && below + candidates[at].promise <= target) {
      below += candidates[at++].promise;
    }
    const Candidate& chosen = candidates[at];
    const float value =
        Connection(vertex, *chosen.light, chosen.depth) * chosen.scale * step / chosen.promise;
    if (!(value > 0)) continue;
    ++rays;
    const SurfacePoint& x = chosen.light->point;
    if (!scene_.Visible(y, x)) continue;
    light += value;
    distances += value / (x.position_m - y.position_m).norm();
  }
  inverse_distance = light > 0 ? distances / light : 0;
  return light;
}

Interreflection::Estimate Interreflection::Sample(const SurfacePoint& first,
                                                  const Eigen::Vector3f& direction,
                                                  PixelSamples& samples) const {
  Estimate estimate;
  CameraVertex vertex;
  vertex.point = first;
  vertex.out = first.ToLocal(-direction.normalized());
  float throughput = 1, distances = 0, first_inverse_distance = 0;
  const auto add = [&](float value, float inverse_distance) {
    estimate.radiance_w_m2_sr += value;
    distances += value * inverse_distance;
  };
  for (;;) {
    float inverse_distance = 0;
    const float connected = Connect(vertex, samples, estimate.rays, inverse_distance);
    if (connected > 0) {
      add(throughput * connected, vertex.depth == 1 ? inverse_distance : first_inverse_distance);
    }
    const auto u = samples.Next();
    const SurfacePoint& point = vertex.point;
    const Material::Sample sample =
        point.material->SampleDirection(vertex.out, point.detail, u[0], u[1], u[2]);
    if (!(sample.pdf > 0) || sample.in.z() <= 0) break;
    throughput *=
        point.material->Brdf(vertex.out, sample.in, point.detail) * sample.in.z() / sample.pdf;
    if (!(throughput > 0)) break;
    if (vertex.depth >= 2) {
      const float survival = std::min(1.0F, throughput * 2);
      if (u[3] >= survival) break;
      throughput /= survival;
    }
    CameraVertex next;
    const Eigen::Vector3f towards = point.ToWorld(sample.in);
    ++estimate.rays;
    if (!scene_.IntersectFrom(point, towards, next.point) || next.point.lamp >= 0) break;
    next.out = next.point.ToLocal(-towards);
    next.depth = vertex.depth + 1;
    const float inverse_square = 1 / (next.point.distance * next.point.distance);
    next.density = sample.pdf * next.out.z() * inverse_square;
    next.previous_density = vertex.density;
    next.previous_geometry = sample.in.z() * inverse_square;
    next.previous_sum = kConnectionsPerVertex;
    if (vertex.depth >= 3) {
      next.previous_sum += vertex.PreviousRatio(sample.in) * vertex.previous_sum;
    }
    if (vertex.depth == 1) first_inverse_distance = 1 / next.point.distance;
    vertex = next;

    // The camera path lies on the lit line.
    Eigen::Vector3f in;
    const float irradiance = LaserIrradiance(scene_, beam_, vertex.point, in, estimate.rays);
    if (irradiance > 0) {
      const float f = vertex.point.material->Brdf(vertex.out, in, vertex.point.detail);
      const float more = vertex.WaysFromLight(irradiance / static_cast<float>(beam_.power_w()), in);
      add(throughput * f * irradiance / (1 + more), first_inverse_distance);
    }
    if (vertex.depth >= max_bounces_ + 1) break;
  }
  if (estimate.radiance_w_m2_sr > 0) {
    estimate.inverse_distance_1_m = distances / estimate.radiance_w_m2_sr;
  }
  return estimate;
}

}  // namespace sightline
