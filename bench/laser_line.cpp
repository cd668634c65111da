// SPDX-License-Identifier: Apache-2.0
// Bias and spread of the laser line detectors on synthetic lines, and their lines on recorded
// images.
#include <png.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "core/laser_line/detect_laser_line.h"
#include "render_worker/sensor/poisson.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;

constexpr LaserLineMethod kMethods[] = {LaserLineMethod::kStegerCentreOfGravity,
                                        LaserLineMethod::kGaussianFit};
constexpr const char* kMethodNames[] = {"centre of gravity", "Gaussian fit"};

struct Errors {
  double found = 0;  // share of columns with a point
  double bias_px = 0, deviation_px = 0;
};

// The centre moves by one pixel over ten columns.
double CentreOf(int column, int rows) {
  const int middle = rows / 2;
  return middle + (column % 10) / 10.0;
}

Errors Measure(const Image<float>& image, const LaserLineOptions& options, LaserLineMethod method) {
  const auto points = DetectLaserLine(image, options, method);
  if (!points.ok()) Fail("laser_line", std::string(points.status().message()));
  Errors e;
  double sum = 0, squares = 0;
  for (const LinePoint& p : *points) {
    const double error = p.row_px - CentreOf(p.column_px, image.rows_px);
    sum += error;
    squares += error * error;
  }
  const double n = static_cast<double>(points->size());
  e.found = n / image.columns_px;
  e.bias_px = sum / n;
  e.deviation_px = std::sqrt((squares - n * e.bias_px * e.bias_px) / (n - 1));
  return e;
}

double PixelMean(double from_centre, double s) {
  const auto below = [&](double x) { return std::erf(x / (s * std::numbers::sqrt2)); };
  return s * std::sqrt(std::numbers::pi / 2) *
         (below(from_centre + 0.5) - below(from_centre - 0.5));
}

// --- shot noise ---------------------------------------------------------------------------------

constexpr double kReadNoise_electrons = 6.5, kBackground_electrons = 27.57;

// Least standard deviation of any unbiased estimate of the centre: the other parameters of a
// symmetric line do not correlate with it.
double CramerRao(double peak, double s) {
  double information = 0;
  for (double x = -20 * s; x <= 20 * s; x += 1) {
    const double mean = peak * PixelMean(x, s);
    const double slope = peak * (PixelMean(x + 1e-4, s) - PixelMean(x - 1e-4, s)) / 2e-4;
    information += slope * slope / (mean + kReadNoise_electrons * kReadNoise_electrons);
  }
  return 1 / std::sqrt(information);
}

Image<float> ShotNoiseLine(int columns, double peak, double s, double clipped_at) {
  const int rows = 2 * static_cast<int>(8 * s + 10);
  Image<float> image(columns, rows);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      CounterRandom random(1, row, column);
      const double mean = peak * PixelMean(row - CentreOf(column, rows), s);
      const double value = PoissonNumber(mean, random) + kReadNoise_electrons * random.Normal() +
                           kBackground_electrons;
      image.At(row, column) = static_cast<float>(std::clamp(value, 0.0, clipped_at));
    }
  }
  return image;
}

Json ShotNoise(int columns) {
  std::printf(
      "\nShot noise, read noise %.1f e-, background %.1f e-, %d columns. Spread over the "
      "Cramer-Rao "
      "bound.\n%8s %8s %10s | %26s | %26s\n%8s %8s %10s | %8s %8s %8s | %8s %8s %8s\n",
      kReadNoise_electrons, kBackground_electrons, columns, "", "", "", kMethodNames[0],
      kMethodNames[1], "s [px]", "peak e-", "bound px", "found", "bias px", "spread", "found",
      "bias px", "spread");
  Json rows = Json::array();
  for (const double s : {0.7, 1.0, 2.0, 4.0, 8.0}) {
    for (const double peak : {50.0, 200.0, 1000.0, 5000.0}) {
      const Image<float> image = ShotNoiseLine(columns, peak, s, 1e9);
      LaserLineOptions options;
      options.ridge_sigma_px = s;
      options.min_ridge_score_dn = 0.4 * peak / (std::pow(2, 1.5) * s * s);
      options.background_dn = kBackground_electrons;
      const double bound = CramerRao(peak, s);
      std::printf("%8.1f %8.0f %10.4f", s, peak, bound);
      Json row = {{"width_px", s}, {"peak_electrons", peak}, {"cramer_rao_px", bound}};
      for (const int m : {0, 1}) {
        const Errors e = Measure(image, options, kMethods[m]);
        std::printf(" | %8.3f %8.4f %8.3f", e.found, e.bias_px, e.deviation_px / bound);
        row[kMethodNames[m]] = {
            {"found", e.found}, {"bias_px", e.bias_px}, {"spread_px", e.deviation_px}};
      }
      std::printf("\n");
      rows.push_back(row);
    }
  }
  return rows;
}

Json Saturation(int columns) {
  std::printf(
      "\nSaturation: s = 3 px, clipped at 1000 e-, noise as above. Spread in px.\n"
      "%10s | %26s | %26s\n%10s | %8s %8s %8s | %8s %8s %8s\n",
      "", kMethodNames[0], kMethodNames[1], "peak/full", "found", "bias px", "px", "found",
      "bias px", "px");
  Json rows = Json::array();
  for (const double factor : {0.8, 1.5, 4.0, 16.0, 64.0}) {
    const Image<float> image = ShotNoiseLine(columns, factor * 1000, 3, 1000);
    LaserLineOptions options;
    options.ridge_sigma_px = 3;
    options.background_dn = kBackground_electrons;
    options.saturation_dn = 1000;
    options.half_window_px = 15;
    options.max_lines = 3;
    std::printf("%10.1f", factor);
    Json row = {{"peak_over_full", factor}};
    for (const int m : {0, 1}) {
      const Errors e = Measure(image, options, kMethods[m]);
      std::printf(" | %8.3f %8.4f %8.4f", e.found, e.bias_px, e.deviation_px);
      row[kMethodNames[m]] = {
          {"found", e.found}, {"bias_px", e.bias_px}, {"spread_px", e.deviation_px}};
    }
    std::printf("\n");
    rows.push_back(row);
  }
  return rows;
}

// --- speckle ------------------------------------------------------------------------------------

// Coherent line of standard deviation s, amplitude point spread exp(-x^2 / (4 r^2)), every column
// its own speckle.
Image<float> SpeckledLine(int columns, double s, double r) {
  constexpr int kSamples = 4;
  const int rows = 2 * static_cast<int>(6 * (s + r) + 10),
            reach = static_cast<int>(6 * r * kSamples);
  Image<float> image(columns, rows);
  std::vector<std::complex<double>> field(static_cast<size_t>(rows) * kSamples);
  for (int column = 0; column < columns; ++column) {
    for (int i = 0; i < rows * kSamples; ++i) {
      const double x = (i + 0.5) / kSamples - 0.5 - CentreOf(column, rows);
      const auto normal = CounterRandom(2, i, column).NormalPair();
      field[i] = std::exp(-x * x / (4 * s * s)) * std::complex<double>(normal[0], normal[1]);
    }
    for (int i = 0; i < rows * kSamples; ++i) {
      std::complex<double> sum = 0;
      for (int k = std::max(-reach, -i); k <= std::min(reach, rows * kSamples - 1 - i); ++k) {
        sum += std::exp(-std::pow(k / (2 * r * kSamples), 2)) * field[i + k];
      }
      image.At(i / kSamples, column) += static_cast<float>(std::norm(sum));
    }
  }
  return image;
}

Json Speckle(int columns) {
  std::printf(
      "\nSpeckle, %d columns. r: standard deviation of the point spread = bound of Dorsch et al. "
      "(lambda / (2 pi sin u)).\nFirst order: sqrt(r s^2 / (2 sqrt(s^2 + r^2))). Spreads over "
      "Dorsch's bound.\n%8s %8s %11s | %26s | %26s\n%8s %8s %11s | %8s %8s %8s | %8s %8s %8s\n",
      columns, "", "", "", kMethodNames[0], kMethodNames[1], "s [px]", "r [px]", "first order",
      "found", "bias px", "spread", "found", "bias px", "spread");
  Json rows = Json::array();
  for (const double r : {0.5, 1.0, 2.0}) {
    for (const double s : {2.0, 4.0, 8.0}) {
      const Image<float> image = SpeckledLine(columns, s, r);
      LaserLineOptions options;
      options.ridge_sigma_px = std::hypot(s, r);
      options.min_ridge_score_dn = 0;
      const double first_order = std::sqrt(r * s * s / (2 * std::hypot(s, r)));
      std::printf("%8.1f %8.1f %11.3f", s, r, first_order / r);
      Json row = {{"width_px", s}, {"point_spread_px", r}, {"first_order_px", first_order}};
      for (const int m : {0, 1}) {
        const Errors e = Measure(image, options, kMethods[m]);
        std::printf(" | %8.3f %8.4f %8.3f", e.found, e.bias_px, e.deviation_px / r);
        row[kMethodNames[m]] = {
            {"found", e.found}, {"bias_px", e.bias_px}, {"spread_px", e.deviation_px}};
      }
      std::printf("\n");
      rows.push_back(row);
    }
  }
  return rows;
}

// --- recorded images ----------------------------------------------------------------------------

// 8-bit grey image, turned so that its columns become rows: the recorded lines run downwards.
Image<float> ReadTransposed(const fs::path& path) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_file(&png, path.c_str())) Fail(path.string(), png.message);
  png.format = PNG_FORMAT_GRAY;
  std::vector<png_byte> grey(PNG_IMAGE_SIZE(png));
  if (!png_image_finish_read(&png, nullptr, grey.data(), 0, nullptr)) {
    Fail(path.string(), png.message);
  }
  Image<float> image(static_cast<int>(png.height), static_cast<int>(png.width));
  for (int row = 0; row < image.columns_px; ++row) {
    for (int column = 0; column < image.rows_px; ++column) {
      image.At(column, row) = grey[static_cast<size_t>(row) * png.width + column];
    }
  }
  return image;
}

// One laser line: points of neighbouring columns less than 4 px apart, gaps up to 60 columns.
using Track = std::vector<LinePoint>;
std::vector<Track> LinkTracks(const std::vector<LinePoint>& points) {
  std::vector<Track> open, closed;
  for (const LinePoint& p : points) {
    Track* best = nullptr;
    for (Track& track : open) {
      const LinePoint& last = track.back();
      if (last.column_px == p.column_px) continue;
      if (std::abs(last.row_px - p.row_px) > 4) continue;
      if (best == nullptr ||
          std::abs(last.row_px - p.row_px) < std::abs(best->back().row_px - p.row_px)) {
        best = &track;
      }
    }
    if (best != nullptr) {
      best->push_back(p);
    } else {
      open.push_back({p});
    }
    for (size_t i = 0; i < open.size();) {
      if (p.column_px - open[i].back().column_px > 60) {
        closed.push_back(std::move(open[i]));
        open.erase(open.begin() + i);
      } else {
        ++i;
      }
    }
  }
  closed.insert(closed.end(), open.begin(), open.end());
  return closed;
}

// Root mean square distance from the least-squares line through 41 neighbours: what speckle and
// noise do; the board is plane.
double Roughness(const Track& track) {
  constexpr int kHalf = 20;
  double squares = 0;
  int count = 0;
  for (int i = kHalf; i + kHalf < static_cast<int>(track.size()); ++i) {
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    const double n = 2 * kHalf + 1;
    for (int k = i - kHalf; k <= i + kHalf; ++k) {
      const double x = track[k].column_px - track[i].column_px, y = track[k].row_px;
      sx += x;
      sy += y;
      sxx += x * x;
      sxy += x * y;
    }
    const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    const double residual = track[i].row_px - (sy - slope * sx) / n;
    squares += residual * residual;
    ++count;
  }
  return std::sqrt(squares / count);
}

// Grey values (upright again) with the points as coloured pixels, enlarged.
void WriteOverlay(const fs::path& path, const Image<float>& image,
                  const std::vector<LinePoint>& points, int first_column, int columns,
                  int first_row, int rows, int zoom) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(rows * zoom);
  png.height = static_cast<png_uint_32>(columns * zoom);
  png.format = PNG_FORMAT_RGB;
  std::vector<png_byte> rgb(PNG_IMAGE_SIZE(png));
  // Dark greys lifted: most of the picture is below 60.
  for (png_uint_32 y = 0; y < png.height; ++y) {
    for (png_uint_32 x = 0; x < png.width; ++x) {
      const float value = image.At(first_row + static_cast<int>(x) / zoom,
                                   first_column + static_cast<int>(y) / zoom);
      const auto shown = static_cast<png_byte>(200 * std::pow(value / 255, 0.6));
      std::fill_n(&rgb[(static_cast<size_t>(y) * png.width + x) * 3], 3, shown);
    }
  }
  for (const LinePoint& p : points) {
    const int y = static_cast<int>((p.column_px - first_column + 0.5) * zoom);
    const int x = static_cast<int>((p.row_px - first_row + 0.5) * zoom);
    for (int dy = -zoom / 4; dy <= zoom / 4; ++dy) {
      for (int dx = -zoom / 4; dx <= zoom / 4; ++dx) {
        const int px = x + dx, py = y + dy;
        if (px < 0 || py < 0 || px >= rows * zoom || py >= columns * zoom) continue;
        png_byte* pixel = &rgb[(static_cast<size_t>(py) * png.width + px) * 3];
        const std::array<png_byte, 3> colour = p.saturated ? std::array<png_byte, 3>{255, 40, 40}
                                                           : std::array<png_byte, 3>{60, 220, 60};
        std::copy(colour.begin(), colour.end(), pixel);
      }
    }
  }
  if (!png_image_write_to_file(&png, path.c_str(), 0, rgb.data(), 0, nullptr)) {
    Fail(path.string(), png.message);
  }
}

Json RecordedImages(const LaserLineOptions& options, const fs::path& out) {
  const char* shared = std::getenv("SIGHTLINE_SHARED_DIR");
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  const fs::path folder =
      (shared != nullptr ? fs::path(shared)
                         : fs::path(source != nullptr ? source : ".") / "../shared") /
      "data/real/multiline_laser";
  if (!fs::exists(folder)) {
    std::printf("\nRecorded images: skipped: no shared data\n");
    return nullptr;
  }
  std::printf(
      "\nRecorded images (multi-line laser head, camera A), sigma %.1f px, score >= %.1f DN/px^2.\n"
      "Lines: at least 300 points. Roughness: rms from the line through 41 neighbours, median of "
      "lines.\n%-10s %9s | %27s | %27s\n%-10s %9s | %8s %8s %9s | %8s %8s %9s\n",
      options.ridge_sigma_px, options.min_ridge_score_dn, "", "", kMethodNames[0], kMethodNames[1],
      "image", "saturated", "points", "lines", "rough px", "points", "lines", "rough px");
  Json rows = Json::array();
  for (int pose = 4; pose <= 180; pose += 16) {
    char name[16];
    std::snprintf(name, sizeof(name), "%04d.png", pose);
    if (!fs::exists(folder / name)) continue;
    const Image<float> image = ReadTransposed(folder / name);
    double saturated = 0;
    for (const float value : image.values) saturated += value >= options.saturation_dn;
    saturated /= static_cast<double>(image.values.size());
    std::printf("%-10s %7.1f %%", name, 100 * saturated);
    Json row = {{"image", name}, {"saturated", saturated}};
    for (const int m : {0, 1}) {
      const Stopwatch watch;
      const auto points = DetectLaserLine(image, options, kMethods[m]);
      const double seconds = watch.Seconds();
      if (!points.ok()) Fail(name, std::string(points.status().message()));
      std::vector<double> roughness;
      for (const Track& track : LinkTracks(*points)) {
        if (track.size() >= 300) roughness.push_back(Roughness(track));
      }
      std::printf(" | %8zu %8zu %9.3f", points->size(), roughness.size(), Median(roughness));
      row[kMethodNames[m]] = {{"points", points->size()},
                              {"lines", roughness.size()},
                              {"roughness_px", Median(roughness)},
                              {"seconds", seconds}};
      if (!out.empty()) {
        fs::create_directories(out);
        const std::string stem =
            std::string("laser_line_") + fs::path(name).stem().string() + (m ? "_fit" : "_cog");
        WriteOverlay(out / (stem + ".png"), image, *points, 0, image.columns_px, 0, image.rows_px,
                     1);
        WriteOverlay(out / (stem + "_detail.png"), image, *points, 300, 160, 380, 200, 6);
      }
    }
    std::printf("\n");
    rows.push_back(row);
  }
  return rows;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Laser line detectors: bias and spread on synthetic lines, recorded images");
  int columns = 4000;
  std::string json, out;
  sightline::LaserLineOptions options;
  options.ridge_sigma_px = 4;
  options.min_ridge_score_dn = 1;
  options.saturation_dn = 255;
  options.max_lines = 100;
  options.background_dn = std::nan("");
  app.add_option("--columns", columns, "of the synthetic images");
  app.add_option("--sigma-px", options.ridge_sigma_px, "recorded images");
  app.add_option("--score", options.min_ridge_score_dn, "recorded images");
  app.add_option("--half-window-px", options.half_window_px, "recorded images");
  app.add_option("--out", out, "folder for pictures; default: beside the JSON file");
  app.add_option("--json", json);
  CLI11_PARSE(app, argc, argv);
  if (out.empty() && !json.empty()) out = std::filesystem::path(json).parent_path().string();
  using namespace sightline::bench;
  PrintMachine();
  Json results;
  results["shot_noise"] = ShotNoise(columns);
  results["saturation"] = Saturation(columns);
  results["speckle"] = Speckle(columns);
  results["recorded"] = RecordedImages(options, out);
  WriteResults(json, "laser_line", results);
  return 0;
}
