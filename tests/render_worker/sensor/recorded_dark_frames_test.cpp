// SPDX-License-Identifier: Apache-2.0
// Dark frames of null recordings, made by another simulator from the same equations, against ours;
// where they lie beside the tree.
#include <gtest/gtest.h>
#include <png.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/json/strict_json.h"
#include "render_worker/sensor/expose.h"
#include "tests/render_worker/sensor/chi_squared.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kBins = 256;

fs::path OpenRecordings() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  return fs::path(source != nullptr ? source : ".") / "../shared/recordings/open";
}

// Adds a 16-bit grey image to a histogram whose last bin takes all larger values.
bool CountValues(const fs::path& path, std::vector<double>* counts) {
  FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) return false;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_read_png(png, info, PNG_TRANSFORM_SWAP_ENDIAN, nullptr);
  const bool grey16 = png_get_bit_depth(png, info) == 16 && png_get_channels(png, info) == 1;
  png_bytepp rows = png_get_rows(png, info);
  for (png_uint_32 row = 0; grey16 && row < png_get_image_height(png, info); ++row) {
    const auto* values = reinterpret_cast<const uint16_t*>(rows[row]);
    for (png_uint_32 column = 0; column < png_get_image_width(png, info); ++column) {
      ++(*counts)[std::min<int>(values[column], kBins - 1)];
    }
  }
  png_destroy_read_struct(&png, &info, nullptr);
  std::fclose(file);
  return grey16;
}

std::vector<const char*> NullSets() {
  std::vector<const char*> sets = {"null_mono", "null_colour"};
  std::erase_if(sets, [](const char* name) { return !fs::exists(OpenRecordings() / name); });
  return sets;
}

class RecordedDarkFrames : public ::testing::TestWithParam<const char*> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(RecordedDarkFrames);

TEST_P(RecordedDarkFrames, HaveTheLawOfOurs) {
  const fs::path folder = OpenRecordings() / GetParam();
  std::ifstream set_file(folder / "recordings.json"), truth_file(folder / "truth.json");
  const Json set = Json::parse(set_file), truth = Json::parse(truth_file);

  // The camera block is a camera file.
  v1::Sensor message;
  ASSERT_TRUE(ParseStrictJson(set["camera"].dump(), "recordings.json", &message).ok());
  const auto sensor = ParseSensor(message, "recordings.json: camera");
  ASSERT_TRUE(sensor.ok()) << sensor.status();
  FrameSetup frame;
  frame.sensor = *sensor;
  const Json& nuisance = truth["nuisance"];
  frame.sensor.gain_dn_per_electron *= 1 + nuisance["gain_relative"].get<double>();
  frame.sensor.dark_mean_electrons += nuisance["dark_mean_electrons"].get<double>();
  frame.sensor.dark_noise_electrons *= 1 + nuisance["dark_noise_relative"].get<double>();
  frame.shutter_open = false;

  std::vector<double> recorded(kBins), simulated(kBins);
  for (const Json& recording : set["recordings"]) {
    if (recording["kind"] != "dark") continue;
    ASSERT_TRUE(CountValues(folder / recording["file"].get<std::string>(), &recorded));
    frame.roi = {recording["roi_column_px"], recording["roi_row_px"], recording["roi_columns_px"],
                 recording["roi_rows_px"]};
    frame.exposure_time_s = recording["exposure_time_s"];
    ++frame.seeds.noise;
    const Image<double> no_light(frame.roi.columns_px, frame.roi.rows_px);
    for (const uint16_t dn : Digitise(CollectElectrons(no_light, frame), frame.sensor).values) {
      ++simulated[std::min<int>(dn, kBins - 1)];
    }
  }
  // Two samples of the same size: (a - b)^2 / (a + b) in bins with at least 10 values.
  double chi_squared = 0, bins = 0, recorded_pixels = 0, simulated_pixels = 0;
  for (int i = 0; i < kBins; ++i) {
    recorded_pixels += recorded[i];
    simulated_pixels += simulated[i];
    const double sum = recorded[i] + simulated[i];
    if (sum < 10) continue;
    chi_squared += (recorded[i] - simulated[i]) * (recorded[i] - simulated[i]) / sum;
    ++bins;
  }
  ASSERT_GT(recorded_pixels, 1e5);
  ASSERT_EQ(recorded_pixels, simulated_pixels);
  EXPECT_GT(ChiSquaredTail(chi_squared, bins - 1), 1e-3) << chi_squared << " of " << bins;
  EXPECT_LT(ChiSquaredTail(chi_squared, bins - 1), 0.999) << chi_squared << " of " << bins;
}

INSTANTIATE_TEST_SUITE_P(NullSets, RecordedDarkFrames, ::testing::ValuesIn(NullSets()));

}  // namespace
}  // namespace sightline
