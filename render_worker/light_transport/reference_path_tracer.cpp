// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/reference_path_tracer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/light_transport/camera_rays.h"
#include "render_worker/light_transport/laser/laser_beam.h"
#include "render_worker/light_transport/tiles.h"

namespace sightline {
namespace {

// radiance(u, v, random, rays): one sample of what arrives at a sensor position.
PlainImage Render(const SubPixelGrid& grid, const PlainSettings& settings,
                  const std::function<double(double, double, CounterRandom&, int64_t&)>& radiance) {
  PlainImage image;
  image.mean = Image<float>(grid.columns(), grid.rows());
  image.standard_error = image.mean;
  std::vector<int64_t> rays(grid.rows(), 0);
  const double pitch = grid.pixel_pitch_m / grid.sub_pixels;
  const auto row_of = [&](int i) {
    for (int j = 0; j < grid.columns(); ++j) {
      double sum = 0, squares = 0;
      CounterRandom random(settings.seed, (uint64_t{1} << 32) * i + j);
      for (int s = 0; s < settings.samples_per_px; ++s) {
        const double u = grid.U(j) + (random.Uniform() - 0.5) * pitch;
        const double v = grid.V(i) + (random.Uniform() - 0.5) * pitch;
        const double value = radiance(u, v, random, rays[i]);
        sum += value;
        squares += value * value;
      }
      const int n = settings.samples_per_px;
      image.mean.At(i, j) = static_cast<float>(sum / n);
      const double variance = std::max(squares / n - sum / n * (sum / n), 0.0);
      image.standard_error.At(i, j) = static_cast<float>(std::sqrt(variance / std::max(n - 1, 1)));
    }
  };
  (void)ForEachTile(grid.rows(), settings.threads, {}, 0, 1, row_of);
  for (const int64_t count : rays) image.rays += count;
  return image;
}

struct Emitter {
  Eigen::Vector3f centre, u, v, normal;
  float area;
  float radiance;
};

}  // namespace

PlainImage PlainPathTracer::TraceIncoherent(const SceneView& view, const SubPixelGrid& grid,
                                            const Spectrum& weight,
                                            const PlainSettings& settings) const {
  const CameraRays camera(view);
  std::vector<Emitter> lamps;
  const auto integrate = [&](const Spectrum& light) {
    double sum = 0;
    for (int b = 0; b < kSpectralBins; ++b) sum += double{light[b]} * weight[b];
    return static_cast<float>(sum);
  };
  for (const EmittingRectangle& lamp : scene_.description().area_lights) {
    const Eigen::Vector3d cross = lamp.half_edge_u_m.cross(lamp.half_edge_v_m);
    lamps.push_back({lamp.centre_m.cast<float>(), lamp.half_edge_u_m.cast<float>(),
                     lamp.half_edge_v_m.cast<float>(), cross.normalized().cast<float>(),
                     static_cast<float>(4 * cross.norm()), integrate(lamp.radiance_w_m2_sr)});
  }
  const float ambient = integrate(scene_.description().ambient_radiance_w_m2_sr);
  const int sources = static_cast<int>(lamps.size()) + (ambient > 0 ? 1 : 0);

  return Render(grid, settings, [&](double u, double v, CounterRandom& random, int64_t& rays) {
    float light = 0, throughput = 1;
    const float u1 = random.UniformFloat(), u2 = random.UniformFloat();
    const CameraRays::Ray ray = camera.PupilRay(u, v, u1, u2);
    SurfacePoint point, next;
    ++rays;
    const auto growth = static_cast<float>(grid.pixel_pitch_m / view.image_distance_m) *
                        ray.depth_m / ray.direction.norm();
    Eigen::Vector3f towards = ray.direction.normalized();
    if (!scene_.Intersect(ray.origin_m, towards, 0, growth, point)) return double{ambient};
    if (point.lamp >= 0) return point.front ? double{lamps[point.lamp].radiance} : 0.0;
    for (int bounce = 0;; ++bounce) {
      const Eigen::Vector3f out = point.ToLocal(-towards);
      if (sources > 0) {
        const int source = std::min(static_cast<int>(random.Uniform() * sources), sources - 1);
        const float a = random.UniformFloat(), b = random.UniformFloat();
        Eigen::Vector3f direction, target;
        float pdf, radiance;
        if (source < static_cast<int>(lamps.size())) {
          const Emitter& lamp = lamps[source];
          target = lamp.centre + (2 * a - 1) * lamp.u + (2 * b - 1) * lamp.v;
          const Eigen::Vector3f to = target - point.position_m;
          direction = to.normalized();
          const float cosine = -direction.dot(lamp.normal);
          pdf = cosine > 0 ? to.squaredNorm() / (cosine * lamp.area * sources) : 0;
          radiance = lamp.radiance;
        } else {
          const float radius = std::sqrt(a);
          const auto angle = static_cast<float>(2 * std::numbers::pi * b);
          const Eigen::Vector3f local(radius * std::cos(angle), radius * std::sin(angle),
                                      std::sqrt(std::max(0.0F, 1 - a)));
          direction = point.ToWorld(local);
          target = point.position_m + 10 * direction;
          pdf = local.z() / static_cast<float>(std::numbers::pi) / sources;
          radiance = ambient;
        }
        const Eigen::Vector3f in = point.ToLocal(direction);
        if (pdf > 0 && in.z() > 0) {
          const float f = point.material->Brdf(out, in, point.detail);
          ++rays;
          if (f > 0 && scene_.Visible(point, target)) {
            light += throughput * f * in.z() * radiance /
                     (pdf + point.material->Pdf(out, in, point.detail));
          }
        }
      }
      const float b1 = random.UniformFloat(), b2 = random.UniformFloat(),
                  b3 = random.UniformFloat();
      const Material::Sample sample =
          point.material->SampleDirection(out, point.detail, b1, b2, b3);
      if (!(sample.pdf > 0) || sample.in.z() <= 0) break;
      throughput *= point.material->Brdf(out, sample.in, point.detail) * sample.in.z() / sample.pdf;
      if (!(throughput > 0)) break;
      towards = point.ToWorld(sample.in);
      ++rays;
      if (!scene_.IntersectFrom(point, towards, next)) {
        const float pdf =
            ambient > 0 ? sample.in.z() / static_cast<float>(std::numbers::pi) / sources : 0;
        light += throughput * ambient * sample.pdf / (sample.pdf + pdf);
        break;
      }
      if (next.lamp >= 0) {
        if (next.front) {
          const Emitter& lamp = lamps[next.lamp];
          const float cosine = -towards.dot(lamp.normal);
          const float pdf = next.distance * next.distance / (cosine * lamp.area * sources);
          light += throughput * lamp.radiance * sample.pdf / (sample.pdf + pdf);
        }
        break;
      }
      if (bounce >= settings.max_bounces) break;
      point = next;
    }
    return double{light};
  });
}

namespace {

PlainImage TraceLaserPaths(const RayScene& scene, const SceneView& view, const SubPixelGrid& grid,
                           const PlainSettings& settings, bool direct) {
  const CameraRays camera(view);
  const LaserBeam beam(view.laser_source, view.laser);
  return Render(grid, settings, [&](double u, double v, CounterRandom& random, int64_t& rays) {
    double light = 0, throughput = 1;
    SurfacePoint point, next;
    Eigen::Vector3f towards = camera.ChiefDirection(u, v).cast<float>().normalized();
    const auto growth = static_cast<float>(grid.pixel_pitch_m / view.image_distance_m);
    ++rays;
    if (!scene.Intersect(camera.origin_m().cast<float>(), towards, 0, growth, point)) return 0.0;
    for (int bounce = 0; point.lamp < 0; ++bounce) {
      const Eigen::Vector3f out = point.ToLocal(-towards);
      if (direct || bounce > 0) {
        const auto c = beam.CoordinatesOf(point.position_m.cast<double>());
        if (beam.Reaches(c, 3)) {
          const Eigen::Vector3f in = point.ToLocal(-beam.Direction(c).cast<float>());
          if (in.z() > 0) {
            ++rays;
            if (scene.Visible(point, beam.SourcePoint(c).cast<float>())) {
              light += throughput * point.material->Brdf(out, in, point.detail) * in.z() *
                       beam.Irradiance_w_m2(c);
            }
          }
        }
      }
      if (bounce >= settings.max_bounces) break;
      const float b1 = random.UniformFloat(), b2 = random.UniformFloat(),
                  b3 = random.UniformFloat();
      const Material::Sample sample =
          point.material->SampleDirection(out, point.detail, b1, b2, b3);
      if (!(sample.pdf > 0) || sample.in.z() <= 0) break;
      throughput *=
          double{point.material->Brdf(out, sample.in, point.detail)} * sample.in.z() / sample.pdf;
      if (!(throughput > 0)) break;
      towards = point.ToWorld(sample.in);
      ++rays;
      if (!scene.IntersectFrom(point, towards, next)) break;
      point = next;
    }
    return light;
  });
}

}  // namespace

PlainImage PlainPathTracer::TraceLaser(const SceneView& view, const SubPixelGrid& grid,
                                       const PlainSettings& settings) const {
  return TraceLaserPaths(scene_, view, grid, settings, true);
}

PlainImage PlainPathTracer::TraceLaserIndirect(const SceneView& view, const SubPixelGrid& grid,
                                               const PlainSettings& settings) const {
  return TraceLaserPaths(scene_, view, grid, settings, false);
}

}  // namespace sightline
