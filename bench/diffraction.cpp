// SPDX-License-Identifier: Apache-2.0
// The Fourier path of the optics against a direct diffraction sum, and what a frame of 1540 x 480
// pixels costs at f/11 and at f/2 with the grid the pupil needs.
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "core/random/counter_random.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/optics/laser_imaging.h"
#include "render_worker/sensor/expose.h"
#include "tests/render_worker/optics/direct_sum.h"

namespace sightline::bench {
namespace {

using std::numbers::pi;

FrameSetup Frame(double f_number, const RegionOfInterest& roi) {
  FrameSetup frame;
  frame.sensor.pixel_pitch_m = 5.86e-6;
  frame.sensor.columns_px = 1936;
  frame.sensor.rows_px = 1216;
  frame.sensor.gain_dn_per_electron = 0.53;
  frame.sensor.saturation_capacity_electrons = 33456;
  frame.sensor.quantum_efficiency[0] = {{661e-9}, {0.48}};
  frame.sensor.dark_noise_electrons = 3.5;
  frame.lens.f_number = f_number;
  frame.lens.focus_distance_m = 0.343;
  frame.laser.power_w = 0.42e-3;
  frame.laser.divergence_rad = 1e-3;
  frame.laser.beam_focus_distance_m = 0.432;
  frame.laser.fan_angle_rad = 43.2 * pi / 180;
  frame.plate = {0.343, 0.39, pi / 4, 0};
  frame.exposure_time_s = 2.5e-5 * f_number * f_number;
  frame.roi = roi;
  return frame;
}

// Largest error of a pixel over the brightest pixel.
Json CompareWithDirectSum(const std::string& name, const FrameSetup& frame, const Lens& lens,
                          const std::vector<double>& depths_m) {
  FrameSetup used = frame;
  used.lens = lens;
  OpticsModel optics = MakeOpticsModel(used, {});
  const Pupil pupil = optics.pupil(0, 0);
  // The direct sum knows nothing of light the pupil stops.
  optics.reference_pupil_radius_m = pupil.radius_m * std::sqrt(ClearFraction(pupil));
  const double p = frame.sensor.pixel_pitch_m;
  IdealImage image;
  image.grid = {
      {-3, -2, 6, 5},
      RequiredSubPixels(2 * pupil.OuterRadius(), optics.wavelength_m, optics.image_distance_m, p),
      1,
      p};
  const SubPixelGrid& grid = image.grid;
  image.laser_irradiance_w_m2 = Image<float>(grid.columns(), grid.rows());
  image.depth_m = Image<float>(grid.columns(), grid.rows());
  SpeckleModel speckle;
  speckle.seed = 5;
  const uint64_t seed = DeriveSeed(speckle.seed, "speckle pattern", 0);
  std::vector<optics_test::Wave> waves;
  for (int i = 0; i < grid.rows(); ++i) {
    for (int j = 0; j < grid.columns(); ++j) {
      const float irradiance = 0.2F + 0.1F * static_cast<float>((3 * i + 5 * j) % 7);
      const float depth = static_cast<float>(depths_m[(i + j / 3) % depths_m.size()]);
      image.laser_irradiance_w_m2.At(i, j) = irradiance;
      image.depth_m.At(i, j) = depth;
      const int row = (grid.roi.row_px - grid.margin_px) * grid.sub_pixels + i;
      const int column = (grid.roi.column_px - grid.margin_px) * grid.sub_pixels + j;
      const auto g = CounterRandom(seed, static_cast<uint64_t>(static_cast<uint32_t>(row)) << 32 |
                                             static_cast<uint32_t>(column))
                         .NormalPair();
      waves.push_back({grid.U(j), grid.V(i),
                       std::sqrt(irradiance / 2.0) * std::complex<double>(g[0], g[1]),
                       optics.curvature(depth, 0, 0)});
    }
  }
  const Image<float> fast = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;
  const LaserTransform transform = PlanLaserTransforms(image, optics, 2).at(0);
  const double columns = transform.columns_px, rows = transform.rows_px;
  optics_test::DirectSum direct(waves, optics, columns * p, rows * p,
                                columns * rows * grid.sub_pixels * grid.sub_pixels);
  double brightest = 0, error = 0;
  for (int i = 0; i < grid.roi.rows_px; ++i) {
    for (int j = 0; j < grid.roi.columns_px; ++j) {
      const double expected =
          direct.PixelMean((grid.roi.column_px + j) * p, (grid.roi.row_px + i) * p, p);
      brightest = std::max(brightest, expected);
      error = std::max(error, std::abs(fast.At(i, j) - expected));
    }
  }
  std::printf("%-34s %3d x %-2d %9d %11.2e\n", name.c_str(), grid.sub_pixels, grid.sub_pixels,
              static_cast<int>(waves.size()), error / brightest);
  return {{"case", name},
          {"sub_pixels", grid.sub_pixels},
          {"scatterers", waves.size()},
          {"relative_error", error / brightest}};
}

// Cost of a frame, stage by stage.
struct CostCase {
  std::string name;
  double f_number;
  bool bent;  // a surface 20 mm deep, so the line bends and goes out of focus
};

Json Cost(const CostCase& cost_case, int threads) {
  const FrameSetup frame = Frame(cost_case.f_number, {-770, -240, 1540, 480});
  PlateScene scene = MakePlateScene(frame);
  double largest_curvature = 0;
  const OpticsModel optics = MakeOpticsModel(frame, {});
  if (cost_case.bent) {
    scene.constant_along_line = false;
    scene.height_m = [](double x_m, double) { return 0.01 * std::sin(2 * pi * x_m / 0.12); };
    const PlateFunction flat = scene.laser_irradiance_w_m2;
    const PlateFunction height = scene.height_m;
    // Sheet at 45 degrees: height moves the line across by as much.
    scene.laser_irradiance_w_m2 = [=](double x_m, double s_m) {
      return flat(x_m, s_m - height(x_m, s_m));
    };
    largest_curvature =
        std::max(std::abs(optics.curvature(0.333, 0, 0)), std::abs(optics.curvature(0.353, 0, 0)));
  }
  Json stages;
  const auto stage = [&](const char* name, const auto& work) {
    const Stopwatch watch;
    auto result = work();
    stages[name] = watch.Seconds();
    return result;
  };
  const Stopwatch whole;
  const SubPixelGrid grid = MakeSubPixelGrid(frame, optics, largest_curvature);
  IdealImage image =
      stage("ideal_image_s", [&] { return RenderPlate(scene, frame, grid, threads); });
  const double before_mib = PeakRssMiB();
  SpeckleModel speckle;
  const PixelIrradiance light =
      stage("optics_s", [&] { return ApplyOptics(image, optics, speckle, threads); });
  const double after_mib = PeakRssMiB();
  const Image<double> mean =
      stage("mean_electrons_s", [&] { return MeanPhotoElectrons(light, frame); });
  const Image<double> electrons = stage("noise_s", [&] { return CollectElectrons(mean, frame); });
  const Image<uint16_t> raw =
      stage("digitise_s", [&] { return Digitise(electrons, frame.sensor); });
  const double total = whole.Seconds();
  double samples = 0;
  const std::vector<LaserTransform> transforms = PlanLaserTransforms(image, optics, threads);
  for (const LaserTransform& transform : transforms) {
    samples += 1e-6 * transform.columns_px * transform.rows_px * grid.sub_pixels * grid.sub_pixels;
  }
  return {{"case", cost_case.name},
          {"f_number", cost_case.f_number},
          {"sub_pixels", grid.sub_pixels},
          {"margin_px", grid.margin_px},
          {"transforms", transforms.size()},
          {"transform_samples_millions", samples},
          {"stages", stages},
          {"total_s", total},
          {"peak_rss_before_optics_mib", before_mib},
          {"peak_rss_mib", after_mib},
          {"largest_dn", *std::max_element(raw.values.begin(), raw.values.end())}};
}

// In a process of its own, so that its peak memory is its own.
Json InOwnProcess(const std::function<Json()>& work) {
  int ends[2];
  if (pipe(ends) != 0) Fail("diffraction", "no pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    const std::string text = work().dump();
    const bool written =
        write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size());
    std::_Exit(written ? 0 : 1);
  }
  close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t n; (n = read(ends[0], buffer, sizeof(buffer))) > 0;) text.append(buffer, n);
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return Json::parse(text);
}

int Run(int threads, const std::string& json) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  PrintMachine();
  Json errors = Json::array(), costs = Json::array();
  const std::vector<CostCase> cases = {{"plate f/11", 11, false},
                                       {"plate f/2", 2, false},
                                       {"bent line f/11", 11, true},
                                       {"bent line f/2", 2, true}};
  std::printf("\n1540 x 480 pixels, %d threads\n%-16s %9s %7s %10s %10s %8s %8s %8s %8s %9s %9s\n",
              threads, "case", "sub-px", "margin", "transforms", "Msamples", "ideal", "optics",
              "sensor", "total s", "MiB ideal", "MiB peak");
  for (const CostCase& cost_case : cases) {
    const Json cost = InOwnProcess([&] { return Cost(cost_case, threads); });
    const Json& stages = cost["stages"];
    std::printf("%-16s %4d x %-2d %7d %10d %10.1f %8.2f %8.2f %8.2f %8.2f %9.0f %9.0f\n",
                cost_case.name.c_str(), cost["sub_pixels"].get<int>(),
                cost["sub_pixels"].get<int>(), cost["margin_px"].get<int>(),
                cost["transforms"].get<int>(), cost["transform_samples_millions"].get<double>(),
                stages["ideal_image_s"].get<double>(), stages["optics_s"].get<double>(),
                stages["mean_electrons_s"].get<double>() + stages["noise_s"].get<double>() +
                    stages["digitise_s"].get<double>(),
                cost["total_s"].get<double>(), cost["peak_rss_before_optics_mib"].get<double>(),
                cost["peak_rss_mib"].get<double>());
    costs.push_back(cost);
  }

  std::printf("\nagainst the direct sum, 6 x 5 pixels\n%-34s %8s %9s %11s\n", "case", "sub-px",
              "waves", "rel. error");
  const FrameSetup frame = Frame(11, {});
  Lens lens = frame.lens;
  errors.push_back(CompareWithDirectSum("focused f/11", frame, lens, {0.343}));
  errors.push_back(CompareWithDirectSum("defocused f/11", frame, lens, {0.3}));
  // Curvatures in even steps, so that each depth is the centre of a layer.
  const auto depth = [](double curvature) { return 1 / (1 / 0.343 - curvature); };
  const double radius = frame.PupilDiameter() / 2;
  const double layer = frame.laser.wavelength_m / (4 * radius * radius);
  errors.push_back(CompareWithDirectSum("three depths f/11", frame, lens,
                                        {depth(0), depth(-2 * layer), depth(-4 * layer)}));
  lens.aperture_blades = 7;
  lens.aperture_rotation_rad = 0.3;
  lens.obstruction_relative = 0.25;
  lens.zernike_m = {0, 0, 0, 0, 0, 8e-8, 0, 1.2e-7, 0, 0, 5e-8};
  errors.push_back(CompareWithDirectSum("blades, obstruction, aberrations", frame, lens, {0.33}));
  lens = frame.lens;
  lens.f_number = 5.6;
  errors.push_back(CompareWithDirectSum("focused f/5.6", frame, lens, {0.343}));
  WriteResults(json, "diffraction", {{"direct_sum", errors}, {"cost", costs}});
  double worst = 0;
  for (const Json& error : errors) worst = std::max(worst, error["relative_error"].get<double>());
  return worst <= 1e-4 ? 0 : 1;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Diffraction: Fourier path against a direct sum, cost of a frame");
  int threads = 2;
  std::string json;
  app.add_option("--threads", threads)->check(CLI::PositiveNumber);
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(threads, json);
}
