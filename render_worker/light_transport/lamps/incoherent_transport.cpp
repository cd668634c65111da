// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/lamps/incoherent_transport.h"

#include <algorithm>
#include <utility>

#include "core/random/counter_random.h"
#include "core/status/status_macros.h"
#include "render_worker/light_transport/adaptive_image.h"
#include "render_worker/light_transport/camera_rays.h"
#include "render_worker/light_transport/lamps/path_tracer.h"

namespace sightline {

absl::StatusOr<IncoherentTransport> TraceIncoherentLight(
    const RayScene& scene, const SceneView& view, const SubPixelGrid& grid,
    const std::vector<Spectrum>& channel_weights, const TransportSettings& settings,
    const TransportProgress& progress) {
  // The last channel is the radiance itself: its noise is what counts.
  std::vector<Spectrum> weights = channel_weights;
  Spectrum one;
  one.fill(1);
  weights.push_back(one);
  const CameraRays camera(view);
  const PathTracer tracer(scene, weights, settings.max_bounces);
  const double pitch_m = grid.pixel_pitch_m / grid.sub_pixels;
  const auto growth = static_cast<float>(pitch_m / view.image_distance_m);

  AdaptiveOptions options;
  options.channels = static_cast<int>(weights.size());
  options.noise_channel = options.channels - 1;
  options.noise_target_relative = settings.noise_target_relative;
  options.first_samples_per_px[kUnfiltered] = std::clamp(settings.first_samples_per_px, 2, 4096);
  // The filter gathers the samples of many pixels.
  options.first_samples_per_px[kFilterable] =
      std::max(options.first_samples_per_px[kUnfiltered] / (settings.filter ? 4 : 1), 2);
  options.max_samples_per_px = settings.max_samples_per_px;
  options.filter = settings.filter;
  options.seed = DeriveSeed(settings.seed, "incoherent");
  options.threads = settings.threads;
  const PixelSample sample = [&](int row, int column, int /*half*/, int part, PixelSamples& samples,
                                 std::span<float> sums, SampleFeatures& features) {
    const auto u = samples.Next();
    const CameraRays::Ray ray = camera.PupilRay(grid.U(column) + (u[0] - 0.5) * pitch_m,
                                                grid.V(row) + (u[1] - 0.5) * pitch_m, u[2], u[3]);
    SurfacePoint first;
    const bool met = scene.Intersect(ray.origin_m, ray.direction, 0, growth * ray.depth_m, first);
    int rays = 1;
    if (!sums.empty() && part == kUnfiltered) {
      rays += tracer.AddDirect(met ? &first : nullptr, ray.direction, samples, sums);
    }
    if (met && first.lamp < 0) {
      features.surface = true;
      features.material = first.material_index;
      features.position_m = first.position_m;
      features.normal = first.normal;
      features.textured = first.material->has_detail();
      features.footprint_m = growth * ray.depth_m * first.distance;
      if (!sums.empty() && part == kFilterable) {
        rays +=
            tracer.AddReflected(first, ray.direction, samples, sums, features.inverse_distance_1_m);
      }
    }
    return rays;
  };
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto traced, SampleAdaptively(grid.columns(), grid.rows(), options, sample, progress, 0, 1));

  IncoherentTransport result;
  for (int c = 0; c < options.channels; ++c) {
    Image<float> image = std::move(traced.unfiltered[c]);
    for (size_t p = 0; p < image.values.size(); ++p) {
      image.values[p] = std::max(image.values[p] + traced.filterable[c].values[p], 0.0F);
    }
    if (c == options.noise_channel) {
      result.radiance_w_m2_sr = std::move(image);
    } else {
      result.channel_radiance.push_back(std::move(image));
    }
  }
  result.standard_error_w_m2_sr = std::move(traced.standard_error);
  result.rays = traced.rays;
  return result;
}

}  // namespace sightline
