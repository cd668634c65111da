// SPDX-License-Identifier: Apache-2.0
// Error of light transport against a plain path tracer (next-event estimation and multiple
// importance sampling, independent samples) at 9 x 1024 samples per pixel, on regions of the
// cylinder head, and the time both need for them.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "bench/transport_scene.h"
#include "render_worker/light_transport/reference_path_tracer.h"
#include "render_worker/light_transport/scene.h"

namespace sightline::bench {
namespace {

struct Region {
  const char* name;
  int column, row;  // top left corner
};
// In the picture of CylinderHeadScene.
constexpr Region kRegions[] = {
    {"outer surface", 888, 590}, {"top plane", 960, 360},     {"port interior", 770, 690},
    {"port rim", 700, 650},      {"near the line", 888, 700}, {"cam trough", 400, 240},
};
constexpr int kMargin_px = 18;  // the filter's reach

Image<float> Inner(const Image<float>& image, int margin) {
  Image<float> inner(image.columns_px - 2 * margin, image.rows_px - 2 * margin);
  for (int i = 0; i < inner.rows_px; ++i) {
    for (int j = 0; j < inner.columns_px; ++j) inner.At(i, j) = image.At(i + margin, j + margin);
  }
  return inner;
}

// Means over blocks of n x n.
Image<float> Binned(const Image<float>& image, int n) {
  Image<float> binned(image.columns_px / n, image.rows_px / n);
  for (int i = 0; i < image.rows_px; ++i) {
    for (int j = 0; j < image.columns_px; ++j) {
      binned.At(i / n, j / n) += image.At(i, j) / static_cast<float>(n * n);
    }
  }
  return binned;
}

double Rmse(const Image<float>& image, const Image<float>& reference) {
  double sum = 0;
  for (size_t p = 0; p < image.values.size(); ++p) {
    sum += std::pow(double{image.values[p]} - reference.values[p], 2);
  }
  return std::sqrt(sum / static_cast<double>(image.values.size()));
}

double MeanOf(const Image<float>& image) {
  double sum = 0;
  for (const float v : image.values) sum += v;
  return sum / static_cast<double>(image.values.size());
}

int Main(int argc, char** argv) {
  CLI::App app("Error of light transport against a plain path tracer");
  std::string glb = "examples/cylinder_head/cylinder_head.glb", out, only;
  int size = 32, plain_samples = 9216, reference_samples = 16384, threads = 2;
  bool laser = true, incoherent = true;
  TransportSettings settings;
  app.add_option("--glb", glb);
  app.add_option("--size", size, "width of a region in pixels");
  app.add_option("--plain-samples", plain_samples);
  app.add_option("--reference-samples", reference_samples, "of our tracer, unfiltered");
  app.add_option("--first-samples", settings.first_samples_per_px);
  app.add_option("--max-samples", settings.max_samples_per_px);
  app.add_option("--noise", settings.noise_target_relative);
  app.add_option("--laser-noise", settings.laser_noise_target_relative);
  app.add_option("--filter", settings.filter);
  app.add_option("--threads", threads);
  app.add_option("--laser", laser);
  app.add_option("--incoherent", incoherent);
  app.add_option("--region", only);
  app.add_option("--out", out);
  CLI11_PARSE(app, argc, argv);
  settings.threads = threads;

  const TransportScene scene = CylinderHeadScene(glb);
  auto transport = LightTransport::Make(scene.scene);
  auto rays = RayScene::Make(scene.scene);
  if (!transport.ok() || !rays.ok()) Fail("scene", "cannot be built");
  const PlainPathTracer plain_tracer(**rays);
  PlainSettings plain;
  plain.samples_per_px = plain_samples;
  plain.max_bounces = settings.max_bounces;
  plain.threads = threads;
  TransportSettings converged = settings;
  converged.filter = false;
  converged.first_samples_per_px = 1024;
  converged.max_samples_per_px = reference_samples;
  converged.noise_target_relative = converged.laser_noise_target_relative = 0;
  converged.seed = 99;
  converged.laser_light_paths = 1 << 18;
  Spectrum one;
  one.fill(1);

  Json results = Json::array();
  PrintMachine();
  std::printf("%-14s %-11s %9s | %9s %9s %9s | %8s %8s | %7s %7s\n", "region", "light", "mean",
              "plain", "its s.e.", "ours", "ratio", "stated", "CPU us", "plain us");
  const auto report = [&](const Region& region, const char* light, const PlainImage& peer,
                          double peer_s, const Image<float>& ours, double ours_us, double stated,
                          const Image<float>& reference) {
    double error2 = 0;
    for (const float e : peer.standard_error.values) error2 += double{e} * e;
    const double peer_stated =
        std::sqrt(error2 / static_cast<double>(peer.standard_error.values.size()));
    const double mean = MeanOf(reference), plain_rmse = Rmse(peer.mean, reference);
    const double rmse = Rmse(ours, reference);
    const double pixels = static_cast<double>(reference.values.size());
    std::printf("%-14s %-11s %9.3g | %8.4f%% %8.4f%% %8.4f%% | %8.3f %7.3f%% | %7.1f %7.0f\n",
                region.name, light, mean, 100 * plain_rmse / mean, 100 * peer_stated / mean,
                100 * rmse / mean, rmse / plain_rmse, 100 * stated / mean, ours_us,
                1e6 * peer_s / pixels);
    std::fflush(stdout);
    results.push_back({{"region", region.name},
                       {"light", light},
                       {"mean_radiance_w_m2_sr", mean},
                       {"plain_rmse_relative", plain_rmse / mean},
                       {"plain_stated_error_relative", peer_stated / mean},
                       {"rmse_relative", rmse / mean},
                       {"stated_error_relative", stated / mean},
                       {"cpu_us_per_px", ours_us},
                       {"plain_cpu_us_per_px", 1e6 * peer_s / pixels}});
  };

  for (const Region& region : kRegions) {
    if (!only.empty() && only != region.name) continue;
    const SubPixelGrid crop = scene.Crop(region.column, region.row, size, size, 1);
    const int wide = size + 2 * kMargin_px;
    const auto margin = [&](int sub_pixels) {
      return scene.Crop(region.column - kMargin_px, region.row - kMargin_px, wide, wide,
                        sub_pixels);
    };
    if (incoherent) {
      double start = OwnCpuSeconds();
      const PlainImage peer = plain_tracer.TraceIncoherent(scene.view, crop, one, plain);
      const double peer_s = OwnCpuSeconds() - start;
      auto reference = (*transport)->TraceIncoherent(scene.view, crop, {}, converged, {});
      start = OwnCpuSeconds();
      auto ours = (*transport)->TraceIncoherent(scene.view, margin(1), {}, settings, {});
      const double ours_us = 1e6 * (OwnCpuSeconds() - start) / (wide * wide);
      if (!ours.ok() || !reference.ok()) Fail(region.name, "not traced");
      double stated = 0;
      const Image<float> errors = Inner(ours->standard_error_w_m2_sr, kMargin_px);
      for (const float e : errors.values) stated += double{e} * e / (size * size);
      report(region, "incoherent", peer, peer_s, Inner(ours->radiance_w_m2_sr, kMargin_px), ours_us,
             std::sqrt(stated), reference->radiance_w_m2_sr);
    }
    if (laser) {
      double start = OwnCpuSeconds();
      const PlainImage peer = plain_tracer.TraceLaserIndirect(scene.view, crop, plain);
      const double peer_s = OwnCpuSeconds() - start;
      TransportSettings laser_converged = converged;
      laser_converged.laser_max_samples_per_px = reference_samples / 4;
      auto reference = (*transport)->TraceLaser(scene.view, crop, laser_converged, {});
      start = OwnCpuSeconds();
      auto ours = (*transport)->TraceLaser(scene.view, margin(3), settings, {});
      const double ours_us = 1e6 * (OwnCpuSeconds() - start) / (wide * wide);
      if (!ours.ok() || !reference.ok()) Fail(region.name, "not traced");
      report(region, "laser", peer, peer_s,
             Inner(Binned(ours->indirect_radiance_w_m2_sr, 3), kMargin_px), ours_us, 0,
             reference->indirect_radiance_w_m2_sr);
    }
  }
  WriteResults(out, "transport_error", results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) { return sightline::bench::Main(argc, argv); }
