// SPDX-License-Identifier: Apache-2.0
// The EMVA 1288 procedure on simulated images of the catalogue's cameras: measured values against
// those of their files, and the time of one frame.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "render_worker/sensor/characterise_sensor.h"
#include "render_worker/sensor/expose.h"

namespace sightline::bench {
namespace {

constexpr const char* kCameras[] = {"cameras/bfly_pge_13e4m", "cameras/bfly_pge_23s6c",
                                    "templates/camera"};

class Table {
 public:
  explicit Table(Json* rows) : rows_(rows) {
    std::printf("%-34s %12s %14s %14s %8s\n", "", "camera file", "measured", "+- (95 %)",
                "dev/s.e.");
  }
  // Relative to the standard error; `unit` follows the name.
  void Row(const std::string& name, double truth, const Estimate& e) {
    const double z = (e.value - truth) / e.standard_error;
    std::printf("%-34s %12.6g %14.6g %14.2g %8.2f%s\n", name.c_str(), truth, e.value,
                1.96 * e.standard_error, z, std::abs(z) > 1.96 ? "  outside 95 %" : "");
    ++count_;
    inside_ += std::abs(z) <= 1.96;
    rows_->push_back({{"quantity", name},
                      {"camera_file", truth},
                      {"measured", e.value},
                      {"standard_error", e.standard_error}});
  }
  void Text(const std::string& name, const std::string& text) {
    std::printf("%-34s %s\n", name.c_str(), text.c_str());
  }
  int count() const { return count_; }
  int inside() const { return inside_; }

 private:
  Json* rows_;
  int count_ = 0, inside_ = 0;
};

Json Characterise(const Sensor& sensor, const CharacterisationSetup& setup, int* count,
                  int* inside) {
  const auto measured = CharacteriseSensor(sensor, setup);
  if (!measured.ok()) Fail(sensor.name, std::string(measured.status().message()));
  Json rows = Json::array();
  Table table(&rows);
  const PhotonTransfer& t = measured->photon_transfer;
  const double eta = sensor.quantum_efficiency[setup.channel].At(setup.wavelength_m);
  table.Row("K [DN/e-]", sensor.gain_dn_per_electron, t.gain_dn_per_electron);
  table.Row("quantum efficiency", eta, t.quantum_efficiency);
  table.Row("temporal dark noise [e-]", sensor.dark_noise_electrons, t.dark_noise_electrons);
  table.Row("dark mean, black level [e-]",
            sensor.dark_mean_electrons + sensor.black_level_dn / sensor.gain_dn_per_electron,
            measured->dark_current.dark_mean_electrons);
  table.Row("dark current by mean [e-/s]", sensor.dark_current_electrons_per_s,
            measured->dark_current.from_mean_electrons_per_s);
  table.Row("dark current by variance [e-/s]", sensor.dark_current_electrons_per_s,
            measured->dark_current.from_variance_electrons_per_s);
  if (measured->over_temperature) {
    table.Row("doubling temperature [K]", sensor.dark_current_doubling_k,
              measured->over_temperature->doubling_k);
  } else {
    table.Text("doubling temperature [K]", "not measurable: no dark current");
  }
  if (sensor.dsnu_electrons > 0) {
    table.Row("DSNU1288 [e-]", sensor.dsnu_electrons, measured->non_uniformity.dsnu_electrons);
  }
  if (sensor.prnu_relative > 0) {
    table.Row("PRNU1288", sensor.prnu_relative, measured->non_uniformity.prnu_relative);
  }
  char line[200];
  std::snprintf(line, sizeof(line), "%.3g e-, %.2g %% (camera file: 0)",
                measured->non_uniformity.dsnu_electrons.value,
                100 * measured->non_uniformity.prnu_relative.value);
  if (sensor.dsnu_electrons == 0) table.Text("DSNU1288, PRNU1288", line);
  std::snprintf(line, sizeof(line),
                "%.0f +- %.0f e-; clipped at %.0f e- of charge (N_sat %.0f, converter %.0f)",
                t.saturation_capacity_electrons.value,
                1.96 * t.saturation_capacity_electrons.standard_error,
                ClippingChargeElectrons(sensor), sensor.saturation_capacity_electrons,
                (sensor.largest_dn() - sensor.black_level_dn) / sensor.gain_dn_per_electron);
  table.Text("saturation (largest variance)", line);
  std::snprintf(line, sizeof(line), "%.4f %% (noise of a linear camera: %.4f %%)",
                100 * t.linearity_error_relative, 100 * t.linearity_noise_relative);
  table.Text("linearity error", line);
  std::snprintf(line, sizeof(line), "%.2f photons; dynamic range %.1f dB; largest SNR %.1f dB",
                t.sensitivity_threshold_photons.value, 20 * std::log10(t.dynamic_range),
                20 * std::log10(t.largest_snr));
  table.Text("sensitivity threshold", line);
  *count += table.count();
  *inside += table.inside();
  return {{"camera", sensor.name},
          {"channel", setup.channel},
          {"quantities", rows},
          {"saturation_electrons", t.saturation_capacity_electrons.value},
          {"linearity_error_relative", t.linearity_error_relative},
          {"linearity_noise_relative", t.linearity_noise_relative}};
}

// Whole frame; one thread, so CPU time is wall time on an idle machine.
Json TimeFrame(Sensor sensor, double electrons, bool pattern) {
  if (pattern) {
    sensor.prnu_relative = 0.01;
    sensor.dsnu_electrons = 3;
  }
  FrameSetup frame;
  frame.sensor = sensor;
  frame.roi = {-sensor.columns_px / 2, -sensor.rows_px / 2, sensor.columns_px, sensor.rows_px};
  frame.seeds = {1, 2, 3, 4};
  const Image<double> light(sensor.columns_px, sensor.rows_px, electrons);
  std::vector<double> seconds;
  for (int i = 0; i < 3; ++i) {
    frame.seeds.noise = i;
    const double start = OwnCpuSeconds();
    const Image<uint16_t> raw = Digitise(CollectElectrons(light, frame), sensor);
    seconds.push_back(OwnCpuSeconds() - start);
    if (raw.values[0] == 65535) std::printf("full\n");  // keeps the work
  }
  const double megapixels = sensor.columns_px * sensor.rows_px * 1e-6;
  std::printf("%-30s %8.2f Mpx %8.0f e- mean %-22s %8.3f CPU s\n", sensor.name.c_str(), megapixels,
              electrons, pattern ? "with PRNU and DSNU" : "without fixed pattern", Median(seconds));
  return {{"camera", sensor.name},
          {"megapixels", megapixels},
          {"mean_electrons", electrons},
          {"fixed_pattern", pattern},
          {"cpu_seconds", Median(seconds)}};
}

int Run(const CharacterisationSetup& base, const std::string& json) {
  PrintMachine();
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  const std::filesystem::path folder =
      std::filesystem::path(source != nullptr ? source : ".") / "examples/catalogue";
  Json tables = Json::array(), times = Json::array();
  int count = 0, inside = 0;
  std::vector<Sensor> sensors;
  for (const char* name : kCameras) {
    const auto sensor = ReadSensorFile((folder / (std::string(name) + ".json")).string());
    if (!sensor.ok()) Fail(name, std::string(sensor.status().message()));
    sensors.push_back(*sensor);
    for (int channel = 0; channel < sensor->channels(); ++channel) {
      CharacterisationSetup setup = base;
      setup.channel = channel;
      setup.seed = base.seed + channel;
      std::printf("\n%s%s, %g nm\n", sensor->name.c_str(),
                  sensor->channels() == 1 ? ""
                  : channel == kRed       ? ", red pixels"
                  : channel == kGreen     ? ", green pixels"
                                          : ", blue pixels",
                  setup.wavelength_m * 1e9);
      tables.push_back(Characterise(*sensor, setup, &count, &inside));
    }
  }
  std::printf("\n%d of %d camera file values inside their 95 %% interval\n\n", inside, count);
  for (const double electrons : {3.0, 100.0, 5000.0}) {
    for (const bool pattern : {false, true}) {
      times.push_back(TimeFrame(sensors[1], electrons, pattern));
    }
  }
  WriteResults(json, "emva1288",
               {{"cameras", tables}, {"inside_95", inside}, {"of", count}, {"frames", times}});
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("EMVA 1288 procedure on the simulated catalogue cameras");
  sightline::CharacterisationSetup setup;
  std::string json;
  app.add_option("--size-px", setup.size_px, "side of the region measured");
  app.add_option("--steps", setup.exposure_steps);
  app.add_option("--frames", setup.stack_frames, "dark and bright frames for DSNU and PRNU");
  app.add_option("--seed", setup.seed);
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(setup, json);
}
