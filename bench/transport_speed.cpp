// SPDX-License-Identifier: Apache-2.0
// Rays per second next to Embree alone on the same rays; cost of the cylinder head image, measured
// on evenly spread crops, against image size, sub-pixels and triangles.
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "bench/transport_scene.h"
#include "core/random/counter_random.h"
#include "render_worker/light_transport/camera_rays.h"
#include "render_worker/light_transport/scene.h"

namespace sightline::bench {
namespace {

struct BenchRay {
  Eigen::Vector3f origin_m, direction;
};

// Camera rays over the whole image, then as many cosine-distributed ones from where these meet.
std::vector<BenchRay> Rays(const RayScene& rays, const TransportScene& scene, bool secondary) {
  const CameraRays camera(scene.view);
  const SubPixelGrid grid = scene.Grid(1);
  std::vector<BenchRay> out;
  for (int i = 0; i < grid.rows(); i += 2) {
    for (int j = 0; j < grid.columns(); j += 2) {
      const Eigen::Vector3f direction = camera.ChiefDirection(grid.U(j), grid.V(i)).cast<float>();
      const Eigen::Vector3f origin = camera.origin_m().cast<float>();
      if (!secondary) {
        out.push_back({origin, direction});
        continue;
      }
      SurfacePoint point;
      if (!rays.Intersect(origin, direction, 0, 0, point) || point.lamp >= 0) continue;
      CounterRandom random(1, out.size());
      const auto sample = point.material->SampleDirection(
          point.ToLocal(-direction.normalized()), point.detail, random.UniformFloat(),
          random.UniformFloat(), random.UniformFloat());
      if (!(sample.pdf > 0)) continue;
      out.push_back({point.position_m + rays.lift_m() * point.normal, point.ToWorld(sample.in)});
    }
  }
  return out;
}

int64_t EmbreeAlone(RTCScene scene, const std::vector<BenchRay>& rays) {
  int64_t hits = 0;
  for (const BenchRay& ray : rays) {
    RTCRayHit query = {};
    query.ray.org_x = ray.origin_m.x();
    query.ray.org_y = ray.origin_m.y();
    query.ray.org_z = ray.origin_m.z();
    query.ray.dir_x = ray.direction.x();
    query.ray.dir_y = ray.direction.y();
    query.ray.dir_z = ray.direction.z();
    query.ray.tfar = std::numeric_limits<float>::infinity();
    query.ray.mask = static_cast<unsigned>(-1);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &query);
    hits += query.hit.geomID != RTC_INVALID_GEOMETRY_ID ? 1 : 0;
  }
  return hits;
}

int64_t OurRays(const RayScene& scene, const std::vector<BenchRay>& rays) {
  int64_t hits = 0;
  SurfacePoint point;
  for (const BenchRay& ray : rays) {
    hits += scene.Intersect(ray.origin_m, ray.direction, 0, 0, point) ? 1 : 0;
  }
  return hits;
}

int Main(int argc, char** argv) {
  CLI::App app("Speed of light transport");
  std::string glb = "examples/cylinder_head/cylinder_head.glb", out;
  int crops = 4, crop_columns = 96, crop_rows = 60, threads = 2;
  bool whole = false;
  TransportSettings settings;
  app.add_option("--glb", glb);
  app.add_option("--crops", crops, "per axis");
  app.add_option("--crop-columns", crop_columns);
  app.add_option("--crop-rows", crop_rows);
  app.add_option("--first-samples", settings.first_samples_per_px);
  app.add_option("--max-samples", settings.max_samples_per_px);
  app.add_option("--noise", settings.noise_target_relative);
  app.add_option("--laser-noise", settings.laser_noise_target_relative);
  app.add_option("--threads", threads);
  app.add_flag("--whole", whole, "the whole 1920 x 1200 image instead of crops");
  app.add_option("--out", out);
  CLI11_PARSE(app, argc, argv);
  settings.threads = threads;
  const TransportScene scene = CylinderHeadScene(glb);
  auto rays = RayScene::Make(scene.scene);
  auto transport = LightTransport::Make(scene.scene);
  if (!rays.ok() || !transport.ok()) Fail("scene", "cannot be built");
  Json results;
  PrintMachine();

  for (const bool secondary : {false, true}) {
    const std::vector<BenchRay> list = Rays(**rays, scene, secondary);
    double ours = 1e30, embree = 1e30;
    int64_t our_hits = 0, embree_hits = 0;
    for (int turn = 0; turn < 3; ++turn) {
      double start = OwnCpuSeconds();
      our_hits = OurRays(**rays, list);
      ours = std::min(ours, OwnCpuSeconds() - start);
      start = OwnCpuSeconds();
      embree_hits = EmbreeAlone((*rays)->embree_scene(), list);
      embree = std::min(embree, OwnCpuSeconds() - start);
    }
    if (our_hits != embree_hits) Fail("rays", "hits differ");
    const double n = static_cast<double>(list.size());
    std::printf("%s rays: ours %.2f M/s, Embree alone %.2f M/s per core (CPU time)\n",
                secondary ? "reflected" : "camera", n / ours * 1e-6, n / embree * 1e-6);
    results[secondary ? "reflected" : "camera"] = {{"ours_rays_per_s", n / ours},
                                                   {"embree_rays_per_s", n / embree}};
  }

  struct Cost {
    double wall_s = 0, cpu_s = 0, rays = 0, pixels = 0;
  };
  const auto measure = [&](int sub_pixels, bool laser, Cost& cost) {
    const int n = whole ? 1 : crops;
    for (int a = 0; a < n; ++a) {
      for (int b = 0; b < n; ++b) {
        const SubPixelGrid grid =
            whole ? scene.Grid(laser ? sub_pixels : 1)
                  : scene.Crop((2 * b + 1) * scene.columns_px / (2 * n) - crop_columns / 2,
                               (2 * a + 1) * scene.rows_px / (2 * n) - crop_rows / 2, crop_columns,
                               crop_rows, laser ? sub_pixels : 1);
        const Stopwatch watch;
        const double start = OwnCpuSeconds();
        if (laser) {
          auto traced = (*transport)->TraceLaser(scene.view, grid, settings, {});
          if (!traced.ok()) Fail("laser", traced.status().ToString());
          cost.rays += static_cast<double>(traced->rays);
        } else {
          auto traced = (*transport)->TraceIncoherent(scene.view, grid, {}, settings, {});
          if (!traced.ok()) Fail("incoherent", traced.status().ToString());
          cost.rays += static_cast<double>(traced->rays);
        }
        cost.wall_s += watch.Seconds();
        cost.cpu_s += OwnCpuSeconds() - start;
        cost.pixels += static_cast<double>(grid.roi.columns_px) * grid.roi.rows_px;
      }
    }
  };
  const double image_px = double{1920} * 1200;
  for (const auto& [name, laser, sub_pixels] :
       {std::tuple{"incoherent", false, 1}, {"laser 1x1", true, 1}, {"laser 3x3", true, 3}}) {
    Cost cost;
    measure(sub_pixels, laser, cost);
    std::printf("%-11s %.1f s, %.1f CPU s, %.1f rays/px, %.1f us/px CPU; 1920 x 1200: %.1f CPU s\n",
                name, cost.wall_s, cost.cpu_s, cost.rays / cost.pixels,
                1e6 * cost.cpu_s / cost.pixels, cost.cpu_s / cost.pixels * image_px);
    std::fflush(stdout);
    results[name] = {{"wall_s", cost.wall_s},
                     {"cpu_s", cost.cpu_s},
                     {"rays_per_px", cost.rays / cost.pixels},
                     {"pixels", cost.pixels},
                     {"image_cpu_s", cost.cpu_s / cost.pixels * image_px}};
  }
  results["peak_rss_mib"] = PeakRssMiB();
  std::printf("peak memory %.0f MiB\n", PeakRssMiB());
  WriteResults(out, "transport_speed", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) { return sightline::bench::Main(argc, argv); }
