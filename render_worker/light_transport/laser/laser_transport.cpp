// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/laser/laser_transport.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/random/counter_random.h"
#include "core/status/status_macros.h"
#include "render_worker/light_transport/adaptive_image.h"
#include "render_worker/light_transport/camera_rays.h"
#include "render_worker/light_transport/laser/interreflection.h"
#include "render_worker/light_transport/laser/laser_beam.h"
#include "render_worker/light_transport/tiles.h"

namespace sightline {
namespace {

constexpr int kSubPixelsPerTask = 16384;
constexpr int kBlock_px = 2;
// Interreflection darker than its mean over the image needs no better than that.
constexpr double kNoiseFloor = 1;
// Nor does interreflection darker than this share of the lit line: a sensor exposed for the line
// does not see it.
constexpr double kFloorOfLine = 1e-4;
// Samples per pixel of details that are smaller than the blocks.
constexpr int kDetailSamples = 16;

// The first hit of every sub-pixel's chief ray, and the laser's direct light there.
class DirectLaser {
 public:
  DirectLaser(const RayScene& scene, const SceneView& view, const SubPixelGrid& grid)
      : scene_(scene),
        camera_(view),
        beam_(view.laser_source, view.laser),
        grid_(grid),
        half_(grid.pixel_pitch_m / grid.sub_pixels / 2),
        growth_(static_cast<float>(2 * half_ / view.image_distance_m)) {}

  // False: the ray meets no surface.
  bool Meet(int row, int column, SurfacePoint& point, Eigen::Vector3d& direction) const {
    direction = camera_.ChiefDirection(grid_.U(column), grid_.V(row));
    return scene_.Intersect(camera_.origin_m().cast<float>(), direction.cast<float>(), 0, growth_,
                            point) &&
           point.lamp < 0;
  }

  float Radiance(int row, int column, const SurfacePoint& point,
                 const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d normal = point.normal.cast<double>();
    const double t = point.distance;
    const Eigen::Vector3d position = camera_.origin_m() + t * direction;
    LaserBeam::Coordinates c = beam_.CoordinatesOf(position);
    if (!(c.z_m > 0)) return 0;
    const double facing = normal.dot(direction);  // < 0
    // Longest edge the footprint can have; most sub-pixels are far from the line.
    const double longest = t * growth_ * (1 - direction.norm() / facing);
    if (std::abs(c.q_m) > kBeamWidths * beam_.Radius_m(c.z_m) + 4 * longest) return 0;
    const Eigen::Vector3f in = point.ToLocal(-beam_.Direction(c).cast<float>());
    if (in.z() <= 0) return 0;

    // Edges of the footprint on the tangent plane: neighbouring rays meet it at position + edge/2.
    const auto edge = [&](double du, double dv) {
      const double u = grid_.U(column), v = grid_.V(row);
      const Eigen::Vector3d change =
          camera_.ChiefDirection(u + du, v + dv) - camera_.ChiefDirection(u - du, v - dv);
      return Eigen::Vector3d(t * (change - direction * (normal.dot(change) / facing)));
    };
    const Eigen::Vector3d edge_u = edge(half_, 0), edge_v = edge(0, half_);
    const Eigen::Vector3d& across = beam_.pose().y_axis;
    const double a = edge_u.dot(across), b = edge_v.dot(across);
    const double reach = std::abs(a) + std::abs(b);
    if (std::abs(c.q_m) > kBeamWidths * beam_.Radius_m(c.z_m) + reach / 2) return 0;
    LaserBeam::Coordinates centre = c;
    centre.q_m = 0;
    if (!beam_.Reaches(centre, kBeamWidths)) return 0;
    const double irradiance = beam_.MeanIrradiance_w_m2(c, a, b) * in.z();
    if (!(irradiance > 0)) return 0;

    // The shadow ray starts where the footprint is nearest to the middle of the sheet; on curved
    // surfaces that place can lie inside the part, then the footprint's centre decides.
    SurfacePoint lit = point;
    bool visible = false;
    if (reach > 0) {
      const double shift = std::clamp(-c.q_m / reach, -0.5, 0.5);
      const Eigen::Vector3d place =
          position + shift * (std::copysign(1.0, a) * edge_u + std::copysign(1.0, b) * edge_v);
      lit.position_m = place.cast<float>();
      visible = scene_.Visible(lit, beam_.SourcePoint(beam_.CoordinatesOf(place)).cast<float>());
    }
    if (!visible) {
      c.q_m = std::clamp(c.q_m, -beam_.Radius_m(c.z_m), beam_.Radius_m(c.z_m));
      if (!scene_.Visible(point, beam_.SourcePoint(c).cast<float>())) return 0;
    }
    const Eigen::Vector3f out = point.ToLocal(-direction.normalized().cast<float>());
    return point.material->Brdf(out, in, point.detail) * static_cast<float>(irradiance);
  }

  const CameraRays& camera() const { return camera_; }
  const LaserBeam& beam() const { return beam_; }
  double half_pitch_m() const { return half_; }
  float growth() const { return growth_; }

 private:
  const RayScene& scene_;
  CameraRays camera_;
  LaserBeam beam_;
  SubPixelGrid grid_;
  double half_;
  float growth_;
};

// Radiance of the lit line across its surface, mean over its power [W/(m^2 sr)].
double LineRadiance(const LightVertices& vertices) {
  double sum = 0;
  for (const LightVertex& v : vertices.AtDepth(1)) {
    sum += double{v.flux_w} * v.density *
           v.point.material->Brdf(Eigen::Vector3f::UnitZ(), v.towards_light, v.point.detail);
  }
  return sum / vertices.paths();
}

// Interreflection of one block seen from a sub-pixel: interpolated from the four blocks around, or
// from the next ring, where they see the same surface. False: none of them does.
bool Interpolate(const AdaptiveResult& coarse, int columns, int rows, double x, double y,
                 const SurfacePoint& point, float& radiance) {
  const int j0 = static_cast<int>(std::floor(x)), i0 = static_cast<int>(std::floor(y));
  for (int ring = 0; ring < 2; ++ring) {
    double sum = 0, weights = 0;
    for (int i = std::max(i0 - ring, 0); i <= std::min(i0 + 1 + ring, rows - 1); ++i) {
      for (int j = std::max(j0 - ring, 0); j <= std::min(j0 + 1 + ring, columns - 1); ++j) {
        const PixelFeatures& f = coarse.features[static_cast<size_t>(i) * columns + j];
        if (!f.uniform || f.material != point.material_index ||
            !SameSurface(f.position_m, f.normal.normalized(), point.position_m, point.normal,
                         f.footprint_m)) {
          continue;
        }
        const double reach = 1 + ring;
        const double w = (reach - std::min(std::abs(x - j), reach)) *
                             (reach - std::min(std::abs(y - i), reach)) +
                         1e-6;
        sum += w * (coarse.unfiltered[0].At(i, j) + coarse.filterable[0].At(i, j));
        weights += w;
      }
    }
    if (weights > 0) {
      radiance = static_cast<float>(std::max(sum / weights, 0.0));
      return true;
    }
  }
  return false;
}

}  // namespace

absl::StatusOr<LaserTransport> TraceLaserLight(const RayScene& scene, const SceneView& view,
                                               const SubPixelGrid& grid,
                                               const TransportSettings& settings,
                                               const TransportProgress& progress) {
  const int columns = grid.columns(), rows = grid.rows();
  LaserTransport result;
  result.radiance_w_m2_sr = Image<float>(columns, rows);
  result.depth_m = Image<float>(columns, rows);
  result.material = Image<uint16_t>(columns, rows, 0xffff);
  result.indirect_radiance_w_m2_sr = Image<float>(columns, rows);
  const DirectLaser direct(scene, view, grid);
  const bool indirect = settings.laser_interreflection && settings.max_bounces > 0;
  const int max_bounces = settings.max_bounces;

  // Interreflection varies slowly: on blocks of pixels, then spread over the sub-pixels.
  const int block = settings.filter ? kBlock_px : 1;
  const int grid_columns = columns / grid.sub_pixels, grid_rows = rows / grid.sub_pixels;
  const int block_columns = (grid_columns + block - 1) / block;
  const int block_rows = (grid_rows + block - 1) / block;
  AdaptiveResult coarse;
  // Light paths of their own for either half of the samples.
  std::unique_ptr<LightVertices> vertices[2];
  std::unique_ptr<Interreflection> interreflection[2];
  const uint64_t seed = DeriveSeed(settings.seed, "laser");
  const double share = indirect ? 0.8 : 0.0;
  int log_detail_samples = 0;
  while ((1 << log_detail_samples) * grid.sub_pixels * grid.sub_pixels < kDetailSamples) {
    ++log_detail_samples;
  }
  if (indirect) {
    for (int half = 0; half < 2; ++half) {
      vertices[half] = std::make_unique<LightVertices>(
          scene, direct.beam(), std::max(1, settings.laser_light_paths / 2), max_bounces,
          DeriveSeed(seed, "light paths", half));
      interreflection[half] =
          std::make_unique<Interreflection>(scene, direct.beam(), *vertices[half], max_bounces);
    }
    AdaptiveOptions options;
    options.noise_target_relative = settings.laser_noise_target_relative;
    options.first_samples_per_px = {0, std::clamp(settings.first_samples_per_px / 4, 2, 4096)};
    options.noise_floor_relative = kNoiseFloor;
    options.noise_floor = kFloorOfLine * LineRadiance(*vertices[0]);
    options.max_samples_per_px = settings.laser_max_samples_per_px;
    options.filter = settings.filter;
    options.seed = seed;
    options.threads = settings.threads;
    const double pitch_m = block * grid.pixel_pitch_m;
    const auto growth = static_cast<float>(pitch_m / view.image_distance_m);
    const Eigen::Vector3f origin = direct.camera().origin_m().cast<float>();
    const PixelSample sample = [&](int row, int column, int half, int /*part*/,
                                   PixelSamples& samples, std::span<float> sums,
                                   SampleFeatures& features) {
      const auto u = samples.Next();
      const double to_sub_pixels = block * grid.sub_pixels;
      const Eigen::Vector3f direction =
          direct.camera()
              .ChiefDirection(grid.U((column + double{u[0]}) * to_sub_pixels - 0.5),
                              grid.V((row + double{u[1]}) * to_sub_pixels - 0.5))
              .cast<float>();
      SurfacePoint first;
      if (!scene.Intersect(origin, direction, 0, growth, first) || first.lamp >= 0) return 1;
      Interreflection::Estimate estimate;
      if (!sums.empty()) {
        estimate = interreflection[half]->Sample(first, direction, samples);
        sums[0] += estimate.radiance_w_m2_sr;
      }
      features.surface = true;
      features.material = first.material_index;
      features.position_m = first.position_m;
      features.normal = first.normal;
      features.textured = first.material->has_detail();
      features.footprint_m = growth * first.distance;
      features.inverse_distance_1_m = estimate.inverse_distance_1_m;
      return 1 + estimate.rays;
    };
    SIGHTLINE_ASSIGN_OR_RETURN(
        coarse, SampleAdaptively(block_columns, block_rows, options, sample, progress, 0, share));
    result.rays += coarse.rays;
  }

  const int rows_per_task = std::max(1, kSubPixelsPerTask / columns);
  const int tasks = (rows + rows_per_task - 1) / rows_per_task;
  std::vector<int64_t> rays(tasks, 0);
  absl::Status status = ForEachTile(tasks, settings.threads, progress, share, 1, [&](int task) {
    for (int i = task * rows_per_task; i < std::min(rows, (task + 1) * rows_per_task); ++i) {
      for (int j = 0; j < columns; ++j) {
        SurfacePoint point;
        Eigen::Vector3d direction;
        ++rays[task];
        if (!direct.Meet(i, j, point, direction)) continue;
        result.depth_m.At(i, j) = point.distance;
        result.material.At(i, j) = point.material_index;
        float radiance = direct.Radiance(i, j, point, direction);
        if (indirect) {
          float reflected = 0;
          const double x = (j + 0.5) / (block * grid.sub_pixels) - 0.5;
          const double y = (i + 0.5) / (block * grid.sub_pixels) - 0.5;
          if (!Interpolate(coarse, block_columns, block_rows, x, y, point, reflected)) {
            // A detail no block around sees alone.
            PixelSamples samples(DeriveSeed(seed, "sub-pixels"), j, i, log_detail_samples);
            for (int s = 0; s < (1 << log_detail_samples); ++s) {
              samples.Start(s);
              const auto estimate =
                  interreflection[(i + j + s) & 1]->Sample(point, direction.cast<float>(), samples);
              reflected += estimate.radiance_w_m2_sr * (1.0F / (1 << log_detail_samples));
              rays[task] += estimate.rays;
            }
          }
          result.indirect_radiance_w_m2_sr.At(i, j) = reflected;
          radiance += reflected;
        }
        result.radiance_w_m2_sr.At(i, j) = radiance;
      }
    }
  });
  if (!status.ok()) return status;
  for (const int64_t r : rays) result.rays += r;
  return result;
}

}  // namespace sightline
