// SPDX-License-Identifier: Apache-2.0
#include "core/frame_light/frame_light.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

using Frames = std::vector<const FrameTiles*>;

constexpr size_t kFewestFrames = 4;
constexpr int kFewestTiles = 100;
constexpr int kBlockPx = 32;
// Blocks of the image nearer to the line than this show the line and its halo.
constexpr double kBesideLinePx = 80;
constexpr double kClippedPart = 0.25;  // of the pixels of a bright block
constexpr int kKnots = 8;              // of the halo, in the logarithm of the distance
constexpr int kAlongBins = 16;
constexpr double kQuantisation = 1.0 / 12;

double Position(double from_line_m, double least_m, double most_m) {
  const double part = std::log(from_line_m / least_m) / std::log(most_m / least_m);
  return std::clamp(part, 0.0, 1.0) * (kKnots - 1);
}

struct DistanceRange {
  double least_m = 1e9, most_m = 0;
};

DistanceRange RangeOf(const Frames& frames) {
  DistanceRange range;
  for (const FrameTiles* frame : frames) {
    for (const BoardTile& tile : frame->tiles) {
      range.least_m = std::min(range.least_m, tile.from_line_m);
      range.most_m = std::max(range.most_m, tile.from_line_m);
    }
  }
  range.most_m = std::max(range.most_m, 1.001 * range.least_m);
  return range;
}

// Means of paper and print in bins of the distance; bins with few tiles of either are left out.
std::vector<HaloBin> BinsOf(const Frames& frames, const DistanceRange& range) {
  constexpr double kFewest = 4;
  struct Sums {
    double distance = 0, dn[2] = {0, 0}, count[2] = {0, 0};
  };
  std::vector<Sums> sums(kKnots);
  for (const FrameTiles* frame : frames) {
    for (const BoardTile& tile : frame->tiles) {
      const double at = Position(tile.from_line_m, range.least_m, range.most_m);
      Sums& sum = sums[static_cast<size_t>(std::lround(at))];
      sum.distance += tile.from_line_m;
      sum.dn[tile.print ? 1 : 0] += tile.raw_dn;
      sum.count[tile.print ? 1 : 0] += 1;
    }
  }
  std::vector<HaloBin> bins;
  for (const Sums& sum : sums) {
    if (std::min(sum.count[0], sum.count[1]) < kFewest) continue;
    bins.push_back({sum.distance / (sum.count[0] + sum.count[1]), sum.dn[0] / sum.count[0],
                    sum.dn[1] / sum.count[1]});
  }
  return bins;
}

// Slope of print over paper, over the bins of each frame with a constant common to all.
double PrintOverPaper(const Frames& frames, const DistanceRange& range) {
  double count = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const FrameTiles* frame : frames) {
    for (const HaloBin& bin : BinsOf({frame}, range)) {
      count += 1;
      x += bin.paper_dn;
      y += bin.print_dn;
      xx += bin.paper_dn * bin.paper_dn;
      xy += bin.paper_dn * bin.print_dn;
    }
  }
  const double spread = count * xx - x * x;
  return spread > 0 ? (count * xy - x * y) / spread : 0;
}

// Exponent of the variance of tiles in the half that is farther from the line.
double NoiseExponent(const Frames& frames, const DistanceRange& range) {
  const double beyond_m = std::sqrt(range.least_m * range.most_m);
  double count = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const FrameTiles* frame : frames) {
    for (const BoardTile& tile : frame->tiles) {
      const double variance = tile.variance_dn2 - kQuantisation;
      if (tile.from_line_m < beyond_m || !(variance > 0.02) || !(tile.raw_dn > 1)) continue;
      const double level = std::log(tile.raw_dn), noise = std::log(variance);
      count += 1;
      x += level;
      y += noise;
      xx += level * level;
      xy += level * noise;
    }
  }
  const double spread = count * xx - x * x;
  return spread > 0 ? (count * xy - x * y) / spread : 0;
}

template <typename Value>
double JackknifeError(const Frames& frames, const Value& value) {
  std::vector<double> without;
  double mean = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    Frames others = frames;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    without.push_back(value(others));
    mean += without.back() / static_cast<double>(frames.size());
  }
  double sum = 0;
  for (const double v : without) sum += (v - mean) * (v - mean);
  const double n = static_cast<double>(frames.size());
  return std::sqrt(sum * (n - 1) / n);
}

enum class HaloModel { kEven, kLens, kBoard };

// One row of the linear model of a tile. kEven: constants of paper and print; kLens: these and the
// halo; kBoard: a constant, and the light on the board times the reflectance.
Eigen::VectorXd RowOf(HaloModel model, const BoardTile& tile, const DistanceRange& range,
                      double print_over_paper) {
  if (model == HaloModel::kEven) return Eigen::Vector2d(tile.print ? 0 : 1, tile.print ? 1 : 0);
  Eigen::VectorXd row = Eigen::VectorXd::Zero(kKnots + 1);
  row[0] = model == HaloModel::kBoard || tile.print ? 1 : 0;
  const double factor = model == HaloModel::kBoard && tile.print ? print_over_paper : 1;
  const double at = Position(tile.from_line_m, range.least_m, range.most_m);
  const int knot = std::min(kKnots - 2, static_cast<int>(at));
  row[1 + knot] = factor * (1 - (at - knot));
  row[2 + knot] = factor * (at - knot);
  return row;
}

// Root mean square error [DN] of all tiles, each frame predicted from the others.
double LeftOutRmsDn(HaloModel model, const Frames& frames, const DistanceRange& range) {
  double sum = 0, count = 0;
  for (size_t k = 0; k < frames.size(); ++k) {
    Frames others = frames;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const double slope = PrintOverPaper(others, range);
    const Eigen::Index size = model == HaloModel::kEven ? 2 : kKnots + 1;
    // A weak prior of 0 keeps knots without tiles finite.
    Eigen::MatrixXd normal = 1e-6 * Eigen::MatrixXd::Identity(size, size);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    for (const FrameTiles* frame : others) {
      for (const BoardTile& tile : frame->tiles) {
        const Eigen::VectorXd row = RowOf(model, tile, range, slope);
        normal += row * row.transpose();
        right += row * tile.raw_dn;
      }
    }
    const Eigen::VectorXd fitted = normal.ldlt().solve(right);
    for (const BoardTile& tile : frames[k]->tiles) {
      const double off = tile.raw_dn - RowOf(model, tile, range, slope).dot(fitted);
      sum += off * off;
      count += 1;
    }
  }
  return std::sqrt(sum / std::max(1.0, count));
}

// Light beside the line by its place along the image, over the median of the frame.
std::map<int, double> AlongLineOf(const FrameTiles& frame, bool along_columns, double extent_px) {
  std::vector<double> all;
  for (const LineSide& side : frame.sides) all.push_back(side.raw_dn);
  if (all.size() < 8) return {};
  const double median = UpperMedian(all);
  std::map<int, std::pair<double, double>> sums;
  for (const LineSide& side : frame.sides) {
    const double at = along_columns ? side.image_px.y() : side.image_px.x();
    const int bin = std::clamp(static_cast<int>(at / extent_px * kAlongBins), 0, kAlongBins - 1);
    sums[bin].first += side.raw_dn / median;
    sums[bin].second += 1;
  }
  std::map<int, double> bins;
  for (const auto& [bin, sum] : sums) bins[bin] = sum.first / sum.second;
  return bins;
}

double Correlation(const std::map<int, double>& a, const std::map<int, double>& b) {
  double count = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (const auto& [bin, value] : a) {
    const auto other = b.find(bin);
    if (other == b.end()) continue;
    count += 1;
    x += value;
    y += other->second;
    xx += value * value;
    yy += other->second * other->second;
    xy += value * other->second;
  }
  const double spread = (count * xx - x * x) * (count * yy - y * y);
  return count >= 4 && spread > 0 ? (count * xy - x * y) / std::sqrt(spread) : 0;
}

void SetAlongLine(const std::vector<std::map<int, double>>& frames, double extent_px,
                  FrameLight* light) {
  for (int bin = 0; bin < kAlongBins; ++bin) {
    std::vector<double> values;
    for (const auto& frame : frames) {
      if (const auto found = frame.find(bin); found != frame.end()) values.push_back(found->second);
    }
    if (2 * values.size() < frames.size() || values.size() < 2) continue;
    double mean = 0, sum = 0;
    for (const double value : values) mean += value / static_cast<double>(values.size());
    for (const double value : values) sum += (value - mean) * (value - mean);
    light->along_line.push_back({(bin + 0.5) * extent_px / kAlongBins, mean,
                                 std::sqrt(sum / static_cast<double>(values.size() - 1))});
  }
  double pairs = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      light->along_line_correlation += Correlation(frames[i], frames[j]);
      pairs += 1;
    }
  }
  if (pairs > 0) light->along_line_correlation /= pairs;
}

// Blocks with many clipped pixels away from the line.
std::vector<bool> BrightBlocks(const Image<uint16_t>& image, double saturation_dn,
                               const LineInFrame& line) {
  const int across = image.columns_px / kBlockPx, down = image.rows_px / kBlockPx;
  std::vector<bool> bright(static_cast<size_t>(across) * static_cast<size_t>(down));
  const Eigen::Vector2d on_line = line.samples[line.samples.size() / 2].image_px;
  for (int b = 0; b < across * down; ++b) {
    const int left = b % across * kBlockPx, top = b / across * kBlockPx;
    const Eigen::Vector2d middle(left + kBlockPx / 2, top + kBlockPx / 2);
    if (std::abs(line.across.dot(middle - on_line)) < kBesideLinePx) continue;
    int clipped = 0;
    for (int row = top; row < top + kBlockPx; ++row) {
      for (int column = left; column < left + kBlockPx; ++column) {
        clipped += image.At(row, column) >= saturation_dn ? 1 : 0;
      }
    }
    bright[static_cast<size_t>(b)] = clipped > kClippedPart * kBlockPx * kBlockPx;
  }
  return bright;
}

}  // namespace

void FrameLightSums::Add(const Image<uint16_t>& image, double saturation_dn,
                         const LineInFrame& line, FrameTiles tiles) {
  columns_px_ = image.columns_px;
  rows_px_ = image.rows_px;
  frames_.push_back({std::move(tiles), BrightBlocks(image, saturation_dn, line),
                     line.clipped_fraction, line.along_columns});
}

FrameLight FrameLightSums::Result() const {
  Frames frames;
  FrameLight light;
  for (const Frame& frame : frames_) {
    frames.push_back(&frame.tiles);
    light.tile_count += static_cast<int>(frame.tiles.tiles.size());
    light.clipped_fraction += frame.clipped_fraction / static_cast<double>(frames_.size());
  }
  if (frames.size() < kFewestFrames || light.tile_count < kFewestTiles) return light;
  light.frame_count = static_cast<int>(frames.size());
  const DistanceRange range = RangeOf(frames);
  light.halo = BinsOf(frames, range);
  const auto slope = [&](const Frames& of) { return PrintOverPaper(of, range); };
  light.print_over_paper = slope(frames);
  light.print_over_paper_error = JackknifeError(frames, slope);
  const auto exponent = [&](const Frames& of) { return NoiseExponent(of, range); };
  light.noise_exponent = exponent(frames);
  light.noise_exponent_error = JackknifeError(frames, exponent);
  light.even_rms_dn = LeftOutRmsDn(HaloModel::kEven, frames, range);
  light.lens_rms_dn = LeftOutRmsDn(HaloModel::kLens, frames, range);
  light.board_rms_dn = LeftOutRmsDn(HaloModel::kBoard, frames, range);

  std::vector<std::map<int, double>> along;
  const bool along_columns = frames_.front().along_columns;
  const double extent_px = along_columns ? rows_px_ : columns_px_;
  for (const Frame& frame : frames_) {
    if (frame.along_columns != along_columns) continue;
    along.push_back(AlongLineOf(frame.tiles, along_columns, extent_px));
  }
  SetAlongLine(along, extent_px, &light);

  BrightPlace bright{.image_px = Eigen::Vector2d::Zero()};
  const int across = columns_px_ / kBlockPx;
  for (size_t b = 0; b < frames_.front().bright_blocks.size(); ++b) {
    const auto count = std::count_if(frames_.begin(), frames_.end(),
                                     [b](const Frame& frame) { return frame.bright_blocks[b]; });
    if (2 * count < light.frame_count) continue;
    const int block = static_cast<int>(b);
    bright.image_px += Eigen::Vector2d(block % across + 0.5, block / across + 0.5) * kBlockPx;
    bright.block_count += 1;
    bright.frame_count = std::max(bright.frame_count, static_cast<int>(count));
  }
  if (bright.block_count > 0) {
    bright.image_px /= bright.block_count;
    light.bright.push_back(bright);
  }
  return light;
}

}  // namespace sightline
