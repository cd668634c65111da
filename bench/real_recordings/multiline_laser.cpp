// SPDX-License-Identifier: Apache-2.0
// Light between the lines of a multi-line laser on a board of printed circles, 8 bits: does it fall
// on the board (the print modulates it) or does it come from the lens (it does not), and does it
// come from the lines?
//   bench_multiline_laser DATA_FOLDER OUT_FOLDER
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "bench/real_recordings/curve_fit.h"
#include "core/image/image.h"

namespace sightline {
namespace {

constexpr int kTile = 50;
constexpr int kFarthest_px = 60;

std::string FileOf(const std::string& data, int number) {
  char name[16];
  std::snprintf(name, sizeof(name), "%04d.png", number);
  return data + "/multiline_laser/" + name;
}

// Grey levels of a PNG with a grey palette; empty: not readable, or not grey.
Image<uint16_t> ReadGrey(const std::string& path) {
  const auto file = OIIO::ImageInput::open(path);
  if (!file) return {};
  const OIIO::ImageSpec& spec = file->spec();
  const auto channels = static_cast<size_t>(spec.nchannels);
  std::vector<uint8_t> bytes(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height) *
                             channels);
  if (!file->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, bytes.data())) return {};
  Image<uint16_t> image(spec.width, spec.height);
  for (size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = bytes[i * channels];
    for (size_t c = 1; c < std::min<size_t>(3, channels); ++c) {
      if (bytes[i * channels + c] != bytes[i * channels]) return {};
    }
  }
  return image;
}

// Distance to the nearest line of the same row, up to kFarthest_px. Lines are upright; on printed
// circles they are dark, so that a column counts as line where any pixel within a circle's diameter
// above or below is bright.
std::vector<int> DistanceToLines(const Image<uint16_t>& recorded, int bright_dn) {
  constexpr int kCircle_px = 60;
  Image<uint16_t> image = recorded;
  for (int j = 0; j < image.columns_px; ++j) {
    int last = -kCircle_px - 1;
    for (int i = 0; i < image.rows_px; ++i) {
      if (recorded.At(i, j) >= bright_dn) last = i;
      if (i - last <= kCircle_px) image.At(i, j) = static_cast<uint16_t>(bright_dn);
    }
    last = image.rows_px + kCircle_px;
    for (int i = image.rows_px - 1; i >= 0; --i) {
      if (recorded.At(i, j) >= bright_dn) last = i;
      if (last - i <= kCircle_px) image.At(i, j) = static_cast<uint16_t>(bright_dn);
    }
  }
  std::vector<int> distance(image.values.size(), kFarthest_px + 1);
  for (int i = 0; i < image.rows_px; ++i) {
    for (int d = 1, j = 0; j < image.columns_px; ++j, ++d) {
      if (image.At(i, j) >= bright_dn) d = 0;
      if (j == 0 && d != 0) d = kFarthest_px + 1;
      auto& here = distance[static_cast<size_t>(i) * image.columns_px + j];
      here = std::min(here, d);
    }
    for (int j = image.columns_px - 1, d = kFarthest_px + 1; j >= 0; --j, ++d) {
      if (image.At(i, j) >= bright_dn) d = 0;
      auto& here = distance[static_cast<size_t>(i) * image.columns_px + j];
      here = std::min(here, d);
    }
  }
  return distance;
}

struct Bin {
  double sum = 0, squares = 0, reflectance = 0, distance = 0, n = 0;
};

void Diagnose(const Image<uint16_t>& lines, const Image<uint16_t>& board, int pose,
              std::ofstream& csv) {
  const std::vector<int> distance = DistanceToLines(lines, 200);
  constexpr int kReflectances = 2, kRings = 16;
  // The board under even light: circles are dark. Middle between the two is a threshold of neither.
  std::vector<uint16_t> sorted = board.values;
  std::sort(sorted.begin(), sorted.end());
  const double dark = sorted[sorted.size() / 20], light = sorted[sorted.size() * 3 / 4];
  std::vector<Bin> bins[2];
  for (auto& half : bins) half.resize(size_t{kReflectances} * kRings);
  for (int i = 0; i < lines.rows_px; ++i) {
    for (int j = 0; j < lines.columns_px; ++j) {
      const int d = distance[static_cast<size_t>(i) * lines.columns_px + j];
      if (d < 4 || d > kFarthest_px) continue;
      const double reflectance = (board.At(i, j) - dark) / (light - dark);
      const bool print = reflectance<0.15, paper = reflectance> 0.7;
      if (!print && !paper) continue;  // edges of circles
      const int ring = std::min(
          kRings - 1, static_cast<int>(kRings * std::log(d / 4.0) / std::log(kFarthest_px / 4.0)));
      Bin& bin =
          bins[(i / kTile + j / kTile) % 2][static_cast<size_t>(paper ? kRings + ring : ring)];
      const double y = lines.At(i, j);
      bin.sum += y;
      bin.squares += y * y;
      bin.reflectance += board.At(i, j);
      bin.distance += d;
      ++bin.n;
    }
  }
  CurveData data;
  std::vector<double> y, sigma, reflectance, away;
  for (int half = 0; half < 2; ++half) {
    for (const Bin& bin : bins[half]) {
      if (bin.n < 200) continue;
      const double mean = bin.sum / bin.n;
      y.push_back(mean);
      // About ten pixels share a grain of speckle and the light of a place: not independent. 2 %
      // for what differs from place to place.
      sigma.push_back(
          std::sqrt(10 * (bin.squares / bin.n - mean * mean) / bin.n + std::pow(0.02 * mean, 2)));
      reflectance.push_back(bin.reflectance / bin.n / light);
      away.push_back(bin.distance / bin.n);
      data.held_out.push_back(half == 1);
    }
  }
  const auto count = static_cast<Eigen::Index>(y.size());
  data.observed = Eigen::Map<Eigen::VectorXd>(y.data(), count);
  data.standard_deviation = Eigen::Map<Eigen::VectorXd>(sigma.data(), count);
  const CurveParameter offset{"offset_dn", 8, 8, 0.01};
  const CurveParameter ambient{"even_light_on_board_dn", 0, 20, 0.01};
  const CurveParameter board_halo{"halo_on_board_dn", 0, 200, 0.01};
  const CurveParameter lens_halo{"halo_in_lens_dn", 0, 200, 0.01};
  const CurveParameter radius{"log_halo_radius_px", std::log(6), 1, 0.001};
  // Halo falling with a power of the distance, in units of its value at 10 px.
  const CurveParameter board_wing{"wing_on_board_dn", 0, 50, 0.01};
  const CurveParameter lens_wing{"wing_in_lens_dn", 0, 50, 0.01};
  const CurveParameter power{"wing_exponent", 2, 1, 0.001};
  struct Model {
    const char* name;
    std::vector<CurveParameter> parameters;
  };
  const std::vector<Model> models = {
      {"offset", {offset}},
      {"offset + even light on board", {offset, ambient}},
      {"offset + halo in lens", {offset, lens_halo, radius}},
      {"offset + halo on board", {offset, board_halo, radius}},
      {"offset + even light on board + halo in lens", {offset, ambient, lens_halo, radius}},
      {"offset + even light on board + halo on board", {offset, ambient, board_halo, radius}},
      {"offset + even light + both halos", {offset, ambient, board_halo, lens_halo, radius}},
      {"offset + even light on board + wing in lens", {offset, ambient, lens_wing, power}},
      {"offset + even light on board + wing on board", {offset, ambient, board_wing, power}},
      {"offset + even light + both wings", {offset, ambient, board_wing, lens_wing, power}},
      {"offset + even light + halo on board + wing in lens",
       {offset, ambient, board_halo, radius, lens_wing, power}}};
  if (pose == 4) {
    csv << "pose,distance_px,reflectance,observed_dn,sigma_dn,held_out";
    for (const Model& model : models) csv << "," << model.name;
    csv << "\n";
  }
  std::printf("pose %d: %d bins\n", pose, static_cast<int>(count));
  std::vector<Eigen::VectorXd> curves;
  for (const Model& model : models) {
    const Curve predict = [&](const Eigen::VectorXd& p) {
      double o = 0, even = 0, on_board = 0, in_lens = 0, log_radius = 0;
      double wing_on_board = 0, wing_in_lens = 0, exponent = 2;
      for (size_t k = 0; k < model.parameters.size(); ++k) {
        const double value = p[static_cast<Eigen::Index>(k)];
        const std::string& name = model.parameters[k].name;
        if (name == offset.name) o = value;
        if (name == ambient.name) even = value;
        if (name == board_halo.name) on_board = value;
        if (name == lens_halo.name) in_lens = value;
        if (name == radius.name) log_radius = value;
        if (name == board_wing.name) wing_on_board = value;
        if (name == lens_wing.name) wing_in_lens = value;
        if (name == power.name) exponent = value;
      }
      Eigen::VectorXd values(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        const auto s = static_cast<size_t>(i);
        const double halo = std::exp(-away[s] / std::exp(log_radius));
        const double wing = std::pow(away[s] / 10, -exponent);
        values[i] = o + reflectance[s] * (even + on_board * halo + wing_on_board * wing) +
                    in_lens * halo + wing_in_lens * wing;
      }
      return values;
    };
    const CurveFit fit = FitCurve(predict, model.parameters, data);
    PrintFit(model.name, fit, model.parameters);
    curves.push_back(fit.curve);
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto s = static_cast<size_t>(i);
    csv << pose << "," << away[s] << "," << reflectance[s] << "," << y[s] << "," << sigma[s] << ","
        << data.held_out[s];
    for (const Eigen::VectorXd& curve : curves) csv << "," << curve[i];
    csv << "\n";
  }

  // Width of the full part of lines, and how alike the speckle at their edges is along them:
  // position of the edge (where the raw number passes 128) minus its mean over 41 rows.
  double widths = 0, runs = 0, full = 0;
  constexpr int kLags = 8;
  double correlation[kLags + 1] = {}, pairs[kLags + 1] = {};
  for (const uint16_t value : lines.values) full += value == 255;
  std::vector<std::vector<int>> starts(static_cast<size_t>(lines.rows_px));
  for (int i = 0; i < lines.rows_px; ++i) {
    for (int j = 1; j < lines.columns_px; ++j) {
      if (lines.At(i, j) < 128 || lines.At(i, j - 1) >= 128) continue;
      int end = j;
      while (end < lines.columns_px && lines.At(i, end) >= 128) ++end;
      if (end - j < 5) continue;  // speckle, not a line
      widths += end - j;
      ++runs;
      starts[static_cast<size_t>(i)].push_back(j);
    }
  }
  // Edge of a line from row to row: the nearest one within 4 px.
  for (int i = 0; i + kLags < lines.rows_px; i += 3) {
    for (const int start : starts[static_cast<size_t>(i)]) {
      std::vector<double> track = {static_cast<double>(start)};
      for (int d = 1; d < 40 && i + d < lines.rows_px; ++d) {
        int best = -1;
        for (const int s : starts[static_cast<size_t>(i) + static_cast<size_t>(d)]) {
          if (std::abs(s - track.back()) <= 4 &&
              (best < 0 || std::abs(s - track.back()) < std::abs(best - track.back()))) {
            best = s;
          }
        }
        if (best < 0) break;
        track.push_back(best);
      }
      if (track.size() < 40) continue;
      double mean = 0;
      for (const double x : track) mean += x / 40;
      for (int lag = 0; lag <= kLags; ++lag) {
        for (size_t t = 0; t + lag < track.size(); ++t) {
          correlation[lag] += (track[t] - mean) * (track[t + lag] - mean);
          ++pairs[lag];
        }
      }
    }
  }
  const double variance = correlation[0] / std::max(1.0, pairs[0]);
  std::printf(
      "  full pixels %.1f %%, width at 128 DN %.2f px, roughness of the edge %.2f px, its "
      "correlation at 1, 2, 4, 8 rows %.2f %.2f %.2f %.2f\n",
      100 * full / static_cast<double>(lines.values.size()), widths / runs, std::sqrt(variance),
      correlation[1] / pairs[1] / variance, correlation[2] / pairs[2] / variance,
      correlation[4] / pairs[4] / variance, correlation[8] / pairs[8] / variance);
}

int Run(const std::string& data, const std::string& out) {
  std::ofstream csv(out + "/multiline_laser.csv");
  int poses = 0;
  for (int pose = 4; pose <= 180; pose += 16) {
    if (!std::filesystem::exists(FileOf(data, pose)) ||
        !std::filesystem::exists(FileOf(data, pose + 2))) {
      continue;
    }
    const Image<uint16_t> lines = ReadGrey(FileOf(data, pose));
    const Image<uint16_t> board = ReadGrey(FileOf(data, pose + 2));
    if (lines.empty() || board.columns_px != lines.columns_px || board.rows_px != lines.rows_px) {
      std::fprintf(stderr, "pose %d: not two grey images of the same size\n", pose);
      return 1;
    }
    Diagnose(lines, board, pose, csv);
    ++poses;
  }
  if (poses == 0) std::printf("skipped: no multi-line laser images in %s\n", data.c_str());
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
