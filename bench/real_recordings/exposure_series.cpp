// SPDX-License-Identifier: Apache-2.0
// The same speckle at several exposure times, 8 bits: which response explains how the raw numbers
// grow?
//   bench_exposure_series DATA_FOLDER OUT_FOLDER
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "bench/real_recordings/curve_fit.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {
namespace {

constexpr int kColumns = 1920, kRows = 1200, kTile = 64;

std::vector<uint8_t> ReadRaw(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return {};
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// Means of pixels that have equally bright neighbours in the middle exposure. The neighbours
// choose, so the pixel's own noise does not; they share its speckle, so the choice spans all
// levels.
struct Level {
  double mean[3] = {0, 0, 0};
  double covariance[3][3] = {};
  double cut[3] = {0, 0, 0};  // pixels at 255
  double n = 0;
};

void CompareResponses(const std::vector<std::vector<uint8_t>>& images, std::ofstream& csv) {
  // 1, 10, 50 ms
  constexpr int kLevels = 40;
  std::vector<Level> levels[2];
  for (auto& half : levels) half.resize(kLevels);
  for (int pass = 0; pass < 2; ++pass) {
    for (int i = 1; i + 1 < kRows; ++i) {
      for (int j = 1; j + 1 < kColumns; ++j) {
        const auto at = [&](int image, int di, int dj) {
          return static_cast<double>(images[static_cast<size_t>(
              image)][static_cast<size_t>(i + di) * kColumns + static_cast<size_t>(j + dj)]);
        };
        const double neighbours = 0.25 * (at(1, -1, 0) + at(1, 1, 0) + at(1, 0, -1) + at(1, 0, 1));
        // Below 2 the pixel may be cut at 0.
        if (neighbours < 2 || neighbours >= 162) continue;
        const int level = static_cast<int>((neighbours - 2) / 4);
        Level& l = levels[(i / kTile + j / kTile) % 2][static_cast<size_t>(level)];
        double y[3];
        for (int k = 0; k < 3; ++k) y[k] = at(k, 0, 0);
        if (pass == 0) {
          for (int k = 0; k < 3; ++k) {
            l.mean[k] += y[k];
            l.cut[k] += y[k] == 255;
          }
          ++l.n;
        } else {
          for (int a = 0; a < 3; ++a) {
            for (int b = 0; b < 3; ++b) {
              l.covariance[a][b] += (y[a] - l.mean[a]) * (y[b] - l.mean[b]) / (l.n * l.n);
            }
          }
        }
      }
    }
    if (pass == 1) break;
    for (auto& half : levels) {
      for (Level& l : half) {
        for (double& mean : l.mean) mean /= std::max(1.0, l.n);
      }
    }
  }
  // Points: mean at 1 ms against 10 ms (10 ms above 40 DN, else 1 ms is cut at 0), and at 50 ms
  // against 10 ms, where no pixel is full.
  struct Point {
    int of;  // 0: 1 ms, 2: 50 ms
    double x;
  };
  std::vector<Point> points;
  std::vector<double> y, sigma;
  CurveData data;
  for (int half = 0; half < 2; ++half) {
    for (const Level& l : levels[half]) {
      if (l.n < 500) continue;
      for (const int of : {0, 2}) {
        if (of == 0 && l.mean[1] < 40) continue;
        // Speckle's tail that is cut would lower the mean.
        if (l.cut[1] > 2e-5 * l.n || l.cut[of] > 2e-5 * l.n) continue;
        const double slope = of == 0 ? 0.1 : 5.0;
        const double variance = l.covariance[of][of] + slope * slope * l.covariance[1][1] -
                                2 * slope * l.covariance[of][1];
        points.push_back({of, l.mean[1]});
        y.push_back(l.mean[of]);
        // Neighbouring pixels share speckle: about four to a grain. Cut-off tails and rounding:
        // 0.02.
        sigma.push_back(std::sqrt(4 * variance + 0.02 * 0.02));
        data.held_out.push_back(half == 1);
      }
    }
  }
  const auto count = static_cast<Eigen::Index>(points.size());
  data.observed = Eigen::Map<Eigen::VectorXd>(y.data(), count);
  data.standard_deviation = Eigen::Map<Eigen::VectorXd>(sigma.data(), count);
  const CurveParameter offset{"offset_dn", 0, 2, 0.01};
  const CurveParameter exposure{"exposure_offset_s", 0, 2e-4, 1e-6};
  const CurveParameter gamma{"exponent", 1, 0.3, 1e-3};
  const CurveParameter drift{"power_50ms_relative", 0, 0.05, 1e-4};
  struct Model {
    const char* name;
    std::vector<CurveParameter> parameters;
  };
  const std::vector<Model> models = {
      {"linear", {}},
      {"offset", {offset}},
      {"exposure offset", {exposure}},
      {"exponent", {gamma}},
      {"power change", {drift}},
      {"offset + exposure offset", {offset, exposure}},
      {"offset + exponent", {offset, gamma}},
      {"offset + power change", {offset, drift}},
      {"exposure offset + power change", {exposure, drift}},
      {"offset + exposure offset + power change", {offset, exposure, drift}},
      {"offset + exponent + exposure offset", {offset, gamma, exposure}}};
  std::vector<Eigen::VectorXd> curves;
  csv << "of,x,y,sigma,held_out";
  for (const Model& model : models) {
    csv << "," << model.name;
    const Curve predict = [&](const Eigen::VectorXd& p) {
      double o = 0, t0 = 0, g = 1, power = 0;
      for (size_t k = 0; k < model.parameters.size(); ++k) {
        const double value = p[static_cast<Eigen::Index>(k)];
        const std::string& name = model.parameters[k].name;
        if (name == offset.name) o = value;
        if (name == exposure.name) t0 = value;
        if (name == gamma.name) g = value;
        if (name == drift.name) power = value;
      }
      Eigen::VectorXd values(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        const Point& point = points[static_cast<size_t>(i)];
        const double time = point.of == 0 ? 1e-3 : 50e-3;
        const double ratio = (time + t0) / (10e-3 + t0) * (point.of == 2 ? 1 + power : 1);
        values[i] = o + (point.x - o) * std::pow(ratio, g);
      }
      return values;
    };
    const CurveFit fit = FitCurve(predict, model.parameters, data);
    PrintFit(model.name, fit, model.parameters);
    curves.push_back(fit.curve);
  }
  csv << "\n";
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto s = static_cast<size_t>(i);
    csv << points[s].of << "," << points[s].x << "," << y[s] << "," << sigma[s] << ","
        << data.held_out[s];
    for (const Eigen::VectorXd& curve : curves) csv << "," << curve[i];
    csv << "\n";
  }
}

// Contrast of the speckle in tiles of 32 px, and its correlation along rows and columns.
void ExplainContrast(double contrast, double correlation);
void MeasureSpeckle(const std::vector<uint8_t>& image, double time_s, std::ofstream& csv) {
  constexpr int kSide = 32, kLag = 8;
  std::vector<double> contrasts;
  double along_row[kLag + 1] = {}, along_column[kLag + 1] = {};
  int tiles = 0;
  for (int top = 0; top + kSide <= kRows; top += kSide) {
    for (int left = 0; left + kSide <= kColumns; left += kSide) {
      double mean = 0, squares = 0;
      int full = 0;
      // A plane through the tile takes out the slow change of the illumination.
      double row_moment = 0, column_moment = 0;
      for (int i = 0; i < kSide; ++i) {
        for (int j = 0; j < kSide; ++j) {
          const double y =
              image[static_cast<size_t>(top + i) * kColumns + static_cast<size_t>(left + j)];
          mean += y;
          full += y == 255;
          row_moment += y * (i - 15.5);
          column_moment += y * (j - 15.5);
        }
      }
      constexpr double kPixels = kSide * kSide,
                       kMoment = kSide * kSide * (kSide * kSide - 1) / 12.0;
      mean /= kPixels;
      if (mean < 8 || full > 0) continue;
      const double down = row_moment / kMoment, across = column_moment / kMoment;
      // Edges of the target are not speckle.
      if (std::hypot(down, across) * kSide > 0.3 * mean) continue;
      std::vector<double> rest(size_t{kSide} * kSide);
      for (int i = 0; i < kSide; ++i) {
        for (int j = 0; j < kSide; ++j) {
          rest[static_cast<size_t>(i) * kSide + static_cast<size_t>(j)] =
              image[static_cast<size_t>(top + i) * kColumns + static_cast<size_t>(left + j)] -
              mean - down * (i - 15.5) - across * (j - 15.5);
          squares += std::pow(rest[static_cast<size_t>(i) * kSide + static_cast<size_t>(j)], 2);
        }
      }
      contrasts.push_back(std::sqrt(squares / kPixels) / mean);
      for (int lag = 0; lag <= kLag; ++lag) {
        double row = 0, column = 0;
        for (int i = 0; i < kSide; ++i) {
          for (int j = 0; j + lag < kSide; ++j) {
            row += rest[static_cast<size_t>(i) * kSide + static_cast<size_t>(j)] *
                   rest[static_cast<size_t>(i) * kSide + static_cast<size_t>(j + lag)];
            column += rest[static_cast<size_t>(j) * kSide + static_cast<size_t>(i)] *
                      rest[static_cast<size_t>(j + lag) * kSide + static_cast<size_t>(i)];
          }
        }
        const double pairs = kSide * (kSide - lag);
        along_row[lag] += row / pairs / (squares / kPixels);
        along_column[lag] += column / pairs / (squares / kPixels);
      }
      ++tiles;
    }
  }
  if (contrasts.empty()) {
    std::printf("%5.0f ms: no tile of speckle without full pixels\n", 1e3 * time_s);
    return;
  }
  std::sort(contrasts.begin(), contrasts.end());
  std::printf(
      "%5.0f ms: %4d tiles, contrast median %.3f (quartiles %.3f, %.3f); correlation at 1, "
      "2, 3, 4 px along rows %.3f %.3f %.3f %.3f, along columns %.3f %.3f %.3f %.3f\n",
      1e3 * time_s, tiles, contrasts[contrasts.size() / 2], contrasts[contrasts.size() / 4],
      contrasts[contrasts.size() * 3 / 4], along_row[1] / tiles, along_row[2] / tiles,
      along_row[3] / tiles, along_row[4] / tiles, along_column[1] / tiles, along_column[2] / tiles,
      along_column[3] / tiles, along_column[4] / tiles);
  ExplainContrast(contrasts[contrasts.size() / 2], 0.5 * (along_row[1] + along_column[1]) / tiles);
  for (int lag = 0; lag <= kLag; ++lag) {
    csv << time_s << "," << lag << "," << along_row[lag] / tiles << "," << along_column[lag] / tiles
        << "\n";
  }
}

// Covariance of neighbours over the squared mean is free of noise: it gives the size of the
// speckle, that gives the contrast of one polarised pattern; what is more is noise, what is less
// more patterns.
void ExplainContrast(double contrast, double correlation) {
  constexpr double kPitch_m = 1, kWavelength_m = 1e-3;  // only their ratio with N counts
  const double covariance = contrast * contrast * correlation;
  for (const int patterns : {1, 2}) {
    double low = 0.05, high = 3;  // lambda N in pixels
    double variance = 0;
    for (int step = 0; step < 40; ++step) {
      const double middle = 0.5 * (low + high);
      Pupil pupil;
      pupil.radius_m = 0.5;
      const SpecklePixelCovariance speckle(
          pupil, [](double, double) { return 1.0; }, kWavelength_m, middle / kWavelength_m,
          kPitch_m, 1);
      variance = speckle.At(0, 0) / patterns;
      (speckle.At(0, 1) / patterns < covariance ? low : high) = middle;
    }
    std::printf(
        "  %d pattern(s): lambda N (1 + m) = %.3f px, contrast of speckle alone %.3f, "
        "squared contrast of all else %.4f\n",
        patterns, low, std::sqrt(variance), contrast * contrast - variance);
  }
}

// Stated and measured exposure times of the structured-light scanner's dark series.
void CompareExposureTimes(const std::string& data) {
  std::ifstream file(data + "/scanner_sim/data/calibrations/camera/dark_frames/exposures.json");
  if (!file) {
    std::printf("skipped: no scanner_sim exposures\n");
    return;
  }
  const auto pairs = nlohmann::json::parse(file).get<std::vector<std::vector<double>>>();
  CurveData points;
  const auto count = static_cast<Eigen::Index>(pairs.size());
  points.observed.resize(count);
  points.standard_deviation.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    points.observed[i] = pairs[static_cast<size_t>(i)][1];
    // Clock of the camera: steps of about 20 us at these times; anything beyond is not its step.
    points.standard_deviation[i] = 1e-5;
    const double off = points.observed[i] / pairs[static_cast<size_t>(i)][0] - 1;
    if (std::abs(off) > 0.05) {
      std::printf("stated %.4g s, true %.6g s: off by %.1f %%\n", pairs[static_cast<size_t>(i)][0],
                  points.observed[i], 100 * off);
    }
    points.held_out.push_back(std::abs(off) > 0.2);
  }
  const Curve predict = [&](const Eigen::VectorXd& p) {
    Eigen::VectorXd values(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      values[i] = pairs[static_cast<size_t>(i)][0] * (1 + (p.size() > 0 ? p[0] : 0)) +
                  (p.size() > 1 ? p[1] : 0);
    }
    return values;
  };
  const CurveParameter rate{"clock_relative", 0, 1e-3, 1e-7}, shift{"offset_s", 0, 1e-4, 1e-7};
  for (const std::vector<CurveParameter>& parameters :
       {std::vector<CurveParameter>{}, {rate}, {rate, shift}}) {
    const CurveFit fit = FitCurve(predict, parameters, points);
    std::printf("exposure times, %zu parameters: chi^2/n %.2f (%d), log evidence %.1f",
                parameters.size(), fit.chi_squared / fit.count, fit.count, fit.log_evidence);
    for (size_t k = 0; k < parameters.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      std::printf("  %s %.3g +- %.2g", parameters[k].name.c_str(), fit.parameters[i],
                  fit.standard_errors[i]);
    }
    std::printf("\n");
  }
}

int Run(const std::string& data, const std::string& out) {
  CompareExposureTimes(data);
  std::vector<std::vector<uint8_t>> images;
  const int times_us[] = {1000, 10000, 50000};
  std::ofstream speckle(out + "/speckle_correlation.csv");
  speckle << "time_s,lag_px,along_row,along_column\n";
  for (const int time_us : times_us) {
    const std::string path =
        data + "/speckle_exposure/captured_image_" + std::to_string(time_us) + "us.raw";
    images.push_back(ReadRaw(path));
    if (images.back().size() != static_cast<size_t>(kColumns) * kRows) {
      std::printf("skipped: %s is not there or has not %d x %d bytes\n", path.c_str(), kColumns,
                  kRows);
      return 0;
    }
    MeasureSpeckle(images.back(), 1e-6 * time_us, speckle);
  }
  std::ofstream csv(out + "/exposure_series.csv");
  CompareResponses(images, csv);
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s DATA_FOLDER OUT_FOLDER\n", argv[0]);
    return 2;
  }
  return sightline::Run(argv[1], argv[2]);
}
