// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/circle_of_confusion.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <map>
#include <vector>

#include "render_worker/optics/parallel_rows.h"

namespace sightline {
namespace {

// Resolution of the radii [samples].
constexpr double kRadiusStep = 0.125;
// Points per sample and axis at which a disc's rim is evaluated.
constexpr int kRimSamples = 8;
// Largest disc that is made sample by sample, and how often samples may double for larger ones.
constexpr float kLargestDisc = 24;
constexpr int kMostLevels = 6;
// Rows that are spread together; fixed, so that sums do not depend on the threads.
constexpr int kBandRows = 32;

// Shares of a disc's light by sample, (2 reach + 1)^2 of them.
struct Disc {
  int reach = 0;
  std::vector<float> shares;
};

Disc MakeDisc(double radius) {
  Disc disc;
  disc.reach = static_cast<int>(std::ceil(radius - 0.5));
  const int size = 2 * disc.reach + 1;
  disc.shares.assign(static_cast<size_t>(size) * size, 0.F);
  double sum = 0;
  for (int i = -disc.reach; i <= disc.reach; ++i) {
    for (int j = -disc.reach; j <= disc.reach; ++j) {
      int inside = 0;
      for (int a = 0; a < kRimSamples; ++a) {
        for (int b = 0; b < kRimSamples; ++b) {
          const double y = i + (a + 0.5) / kRimSamples - 0.5, x = j + (b + 0.5) / kRimSamples - 0.5;
          inside += x * x + y * y <= radius * radius ? 1 : 0;
        }
      }
      disc.shares[static_cast<size_t>(i + disc.reach) * size + j + disc.reach] =
          static_cast<float>(inside);
      sum += inside;
    }
  }
  for (float& share : disc.shares) share = static_cast<float>(share / sum);
  return disc;
}

// Discs larger than this are made of samples 2^level times as large: their rim is no finer than
// that to their size, and the work stays bounded.
int LevelOf(float radius) {
  int level = 0;
  while (radius > kLargestDisc * static_cast<float>(1 << level) && level < kMostLevels) ++level;
  return level;
}

int RadiusIndex(float radius) {
  assert(radius >= 0);
  return static_cast<int>(std::lround(std::min(radius, kLargestDisc) / kRadiusStep));
}

// All radii are at most kLargestDisc.
Image<float> SpreadSmall(const Image<float>& light, const Image<float>& radius_samples,
                         int threads) {
  std::map<int, Disc> discs;
  int reach = 0;
  for (size_t i = 0; i < light.values.size(); ++i) {
    const int index = RadiusIndex(radius_samples.values[i]);
    // Within half a sample the light stays where it is.
    if (index * kRadiusStep <= 0.5 || light.values[i] == 0) continue;
    const auto [disc, added] = discs.try_emplace(index);
    if (added) disc->second = MakeDisc(index * kRadiusStep);
    reach = std::max(reach, disc->second.reach);
  }
  if (discs.empty()) return light;

  const int bands = (light.rows_px + kBandRows - 1) / kBandRows;
  std::vector<Image<float>> spread(static_cast<size_t>(bands));
  ForIndexRanges(threads, bands, [&](int begin, int end) {
    for (int band = begin; band < end; ++band) {
      Image<float>& out = spread[static_cast<size_t>(band)];
      out = Image<float>(light.columns_px, kBandRows + 2 * reach);
      const int first = band * kBandRows;
      for (int row = first; row < std::min(first + kBandRows, light.rows_px); ++row) {
        for (int column = 0; column < light.columns_px; ++column) {
          const float value = light.At(row, column);
          if (value == 0) continue;
          const auto disc = discs.find(RadiusIndex(radius_samples.At(row, column)));
          if (disc == discs.end()) {
            out.At(row - first + reach, column) += value;
            continue;
          }
          const int r = disc->second.reach, size = 2 * r + 1;
          const int left = std::max(column - r, 0);
          const int right = std::min(column + r, light.columns_px - 1);
          for (int i = -r; i <= r; ++i) {
            const float* shares =
                disc->second.shares.data() + static_cast<size_t>(i + r) * size + (r - column);
            float* to = out.Row(row - first + reach + i);
            for (int j = left; j <= right; ++j) to[j] += value * shares[j];
          }
        }
      }
    }
  });
  Image<float> result(light.columns_px, light.rows_px);
  for (int band = 0; band < bands; ++band) {
    const Image<float>& part = spread[static_cast<size_t>(band)];
    for (int i = 0; i < part.rows_px; ++i) {
      const int row = band * kBandRows - reach + i;
      if (row < 0 || row >= light.rows_px) continue;
      for (int column = 0; column < light.columns_px; ++column) {
        result.At(row, column) += part.At(i, column);
      }
    }
  }
  return result;
}

// A level's share of the light on samples 2^level times as large, and its radii in those.
struct Coarse {
  Image<float> light, radii;
};
Coarse MakeCoarse(const Image<float>& light, const Image<float>& radius_samples, int level) {
  const int size = 1 << level;
  Coarse coarse{
      Image<float>((light.columns_px + size - 1) / size, (light.rows_px + size - 1) / size),
      Image<float>((light.columns_px + size - 1) / size, (light.rows_px + size - 1) / size)};
  for (int row = 0; row < light.rows_px; ++row) {
    for (int column = 0; column < light.columns_px; ++column) {
      const float radius = radius_samples.At(row, column);
      if (LevelOf(radius) != level) continue;
      coarse.light.At(row / size, column / size) += light.At(row, column);
      float& largest = coarse.radii.At(row / size, column / size);
      largest = std::max(largest, radius / static_cast<float>(size));
    }
  }
  return coarse;
}

}  // namespace

Image<float> SpreadByDefocus(const Image<float>& light, const Image<float>& radius_samples,
                             int threads) {
  assert(light.columns_px == radius_samples.columns_px && light.rows_px == radius_samples.rows_px);
  int levels = 0;
  for (const float radius : radius_samples.values) levels = std::max(levels, LevelOf(radius));
  if (levels == 0) return SpreadSmall(light, radius_samples, threads);
  Image<float> result(light.columns_px, light.rows_px);
  for (int level = 0; level <= levels; ++level) {
    const Coarse coarse = MakeCoarse(light, radius_samples, level);
    const Image<float> spread = SpreadSmall(coarse.light, coarse.radii, threads);
    const float share = 1.0F / static_cast<float>(1 << (2 * level));
    for (int row = 0; row < result.rows_px; ++row) {
      for (int column = 0; column < result.columns_px; ++column) {
        result.At(row, column) += share * spread.At(row >> level, column >> level);
      }
    }
  }
  return result;
}

}  // namespace sightline
