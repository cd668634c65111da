// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/adaptive_image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/random/counter_random.h"
#include "core/status/status_macros.h"
#include "render_worker/light_transport/feature_filter.h"
#include "render_worker/light_transport/tiles.h"

namespace sightline {
namespace {

// Samples one task takes at most: some 10 ms, so that cancelling is quick.
constexpr int kSamplesPerTask = 1024;
constexpr int kGainWindow_px = 3;      // half width
constexpr int kBiasWindow_px = 8;      // half width
constexpr int kSpreadWindow_px = 1;    // half width
constexpr int kErrorWindow_px = 4;     // half width
constexpr int kDistanceWindow_px = 2;  // half width
constexpr int kFilterRowsPerTask = 2;

// Sums over the window of half width `half` around every pixel.
std::vector<float> WindowSums(int columns, int rows, int half, const std::vector<float>& values) {
  std::vector<float> lines(values.size(), 0), sums(values.size(), 0);
  for (int i = 0; i < rows; ++i) {
    const float* in = values.data() + static_cast<size_t>(i) * columns;
    float* out = lines.data() + static_cast<size_t>(i) * columns;
    for (int d = -half; d <= half; ++d) {
      const int end = std::min(columns, columns - d);
      for (int j = std::max(0, -d); j < end; ++j) out[j] += in[j + d];
    }
  }
  for (int i = 0; i < rows; ++i) {
    float* out = sums.data() + static_cast<size_t>(i) * columns;
    for (int y = std::max(i - half, 0); y <= std::min(i + half, rows - 1); ++y) {
      const float* in = lines.data() + static_cast<size_t>(y) * columns;
      for (int j = 0; j < columns; ++j) out[j] += in[j];
    }
  }
  return sums;
}

// Means over windows of the pixels that count (1, others 0); 0 where none does.
std::vector<float> WindowMeans(int columns, int rows, int half, std::vector<float> values,
                               const std::vector<float>& counts) {
  for (size_t p = 0; p < values.size(); ++p) values[p] *= counts[p];
  std::vector<float> means = WindowSums(columns, rows, half, values);
  const std::vector<float> weights = WindowSums(columns, rows, half, counts);
  for (size_t p = 0; p < values.size(); ++p) {
    means[p] = weights[p] > 0 ? means[p] / weights[p] : 0;
  }
  return means;
}

// The samples of all pixels so far.
class SampledImage {
 public:
  SampledImage(int columns, int rows, const AdaptiveOptions& options, const PixelSample& sample)
      : columns_(columns),
        rows_(rows),
        options_(options),
        sample_(sample),
        pixels_(static_cast<size_t>(columns) * rows),
        stride_(2 * options.channels),
        count_{std::vector<int>(pixels_, 0), std::vector<int>(pixels_, 0)},
        rays_(pixels_, 0),
        spread_(2 * pixels_, 0),
        features_(pixels_) {
    for (PixelValues* part : {&sums_[0], &sums_[1]}) {
      *part = {columns, rows, stride_, std::vector<float>(pixels_ * stride_, 0)};
    }
  }

  // Takes `samples` more of one part in each pixel of the list.
  absl::Status Sample(int part, const std::vector<uint32_t>& list, int samples, int round,
                      const TransportProgress& progress, double from, double to) {
    const int per_task = std::max(1, kSamplesPerTask / samples);
    const int tasks = static_cast<int>((list.size() + per_task - 1) / per_task);
    return ForEachTile(tasks, options_.threads, progress, from, to, [&](int task) {
      const size_t end = std::min(list.size(), static_cast<size_t>(task + 1) * per_task);
      for (size_t k = static_cast<size_t>(task) * per_task; k < end; ++k) {
        SamplePixel(part, list[k], samples, round);
      }
    });
  }

  // Means of the halves, part 0: unfiltered, 1: filterable.
  PixelValues Means(int part) const {
    PixelValues means = sums_[part];
    for (size_t p = 0; p < pixels_; ++p) {
      if (count_[part][p] == 0) continue;
      const float inverse = 2 / static_cast<float>(count_[part][p]);
      for (int c = 0; c < stride_; ++c) means.At(p)[c] *= inverse;
    }
    return means;
  }

  // Variance of a pixel's mean from the spread of its samples, as if they were independent.
  float SpreadVariance(int part, size_t p) const {
    if (count_[part][p] == 0) return 0;
    const auto n = static_cast<float>(count_[part][p]);
    const float* sums = sums_[part].At(p);
    const int c = options_.noise_channel;
    const float mean = (sums[c] + sums[options_.channels + c]) / n;
    return std::max(spread_[2 * p + part] / n - mean * mean, 0.0F) / (n - 1);
  }
  // From the difference of the halves.
  float HalvesVariance(const PixelValues& means, size_t p) const {
    const float* v = means.At(p);
    const int c = options_.noise_channel;
    const float difference = v[c] - v[options_.channels + c];
    return difference * difference / 4;
  }

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  size_t pixels() const { return pixels_; }
  int stride() const { return stride_; }
  const std::vector<int>& count(int part) const { return count_[part]; }
  std::vector<PixelFeatures>& features() { return features_; }
  int64_t rays() const {
    int64_t total = 0;
    for (const int64_t r : rays_) total += r;
    return total;
  }

 private:
  void SamplePixel(int part, uint32_t pixel, int samples, int round) {
    const int row = static_cast<int>(pixel) / columns_, column = static_cast<int>(pixel) % columns_;
    const int channels = options_.channels;
    std::array<float, 16> sums;
    PixelFeatures& mean = features_[pixel];
    const int half_samples = samples / 2;
    for (int half = 0; half < 2; ++half) {
      PixelSamples points(DeriveSeed(options_.seed, "halves", 4 * round + 2 * part + half), column,
                          row, std::bit_width(static_cast<unsigned>(half_samples)) - 1);
      for (int s = 0; s < half_samples; ++s) {
        points.Start(s);
        std::fill(sums.begin(), sums.begin() + channels, 0.0F);
        SampleFeatures features;
        rays_[pixel] +=
            sample_(row, column, half, part, points, std::span(sums.data(), channels), features);
        float* total = sums_[part].At(pixel) + ptrdiff_t{half} * channels;
        for (int c = 0; c < channels; ++c) total[c] += sums[c];
        const float noise = sums[options_.noise_channel];
        spread_[2 * pixel + part] += noise * noise;
        mean.textured = mean.textured || features.textured;
        const int n = count_[0][pixel] + count_[1][pixel];
        ++count_[part][pixel];
        if (n == 0) {
          mean.material = features.material;
        } else if (mean.material != features.material ||
                   (features.surface &&
                    !SameSurface(mean.position_m, mean.normal.normalized(), features.position_m,
                                 features.normal, features.footprint_m))) {
          mean.uniform = false;
        }
        const float weight = 1 / static_cast<float>(n + 1);
        mean.position_m += (features.position_m - mean.position_m) * weight;
        mean.normal += (features.normal - mean.normal) * weight;
        mean.footprint_m += (features.footprint_m - mean.footprint_m) * weight;
        if (part == kFilterable) {
          mean.inverse_distance_1_m += (features.inverse_distance_1_m - mean.inverse_distance_1_m) /
                                       static_cast<float>(count_[part][pixel]);
        }
      }
    }
  }

  int columns_, rows_;
  AdaptiveOptions options_;
  const PixelSample& sample_;
  size_t pixels_;
  int stride_;
  PixelValues sums_[2];  // half 0's channels, half 1's channels
  std::vector<int> count_[2];
  std::vector<int64_t> rays_;
  std::vector<float> spread_;  // sums of squares of the noise channel, both parts
  std::vector<PixelFeatures> features_;
};

// Variance of every pixel's mean: the spread of its own samples, times what low-discrepancy points
// gain over independent ones, taken from the halves of the pixels around.
std::vector<float> UnfilteredVariance(const SampledImage& image, int part,
                                      const PixelValues& means) {
  const std::vector<float> all(image.pixels(), 1);
  std::vector<float> halves(image.pixels()), spread(image.pixels()), variance(image.pixels());
  for (size_t p = 0; p < image.pixels(); ++p) {
    halves[p] = image.HalvesVariance(means, p);
    spread[p] = image.SpreadVariance(part, p);
  }
  const auto h = WindowMeans(image.columns(), image.rows(), kGainWindow_px, halves, all);
  const auto s = WindowMeans(image.columns(), image.rows(), kGainWindow_px, spread, all);
  for (size_t p = 0; p < image.pixels(); ++p) {
    variance[p] = s[p] > 0 ? spread[p] * std::clamp(h[p] / s[p], 0.02F, 2.0F) : 0;
  }
  return variance;
}

// Filters the filterable part of an image. Plane and paraboloid are mixed in the proportion that
// leaves the least mean square error: with D the variance of their difference and b^2 the square of
// its expectation, the plane has a share D / (D + b^2) (the plane's noise is independent of the
// difference if the light is a plane). Variance from the difference of the halves, b^2 from the
// product of what they say; both are means over the pixels around. `error2` is the variance and the
// square of the plane's remaining bias; 0 where nothing was filtered.
absl::Status Filter(SampledImage& image, const PixelValues& noisy, const AdaptiveOptions& options,
                    const TransportProgress& progress, double from, double to,
                    PixelValues& filtered, std::vector<float>& error2) {
  const int columns = image.columns(), rows = image.rows();
  const size_t pixels = image.pixels();
  std::vector<PixelFeatures> features = image.features();
  std::vector<float> counts(pixels);
  for (size_t p = 0; p < pixels; ++p) counts[p] = features[p].uniform ? 1.0F : 0.0F;
  {
    // The distance of what lights the surface, averaged over neighbours: from one pixel's samples
    // it would vary with their noise.
    std::vector<float> distances(pixels);
    for (size_t p = 0; p < pixels; ++p) distances[p] = features[p].inverse_distance_1_m;
    distances =
        WindowMeans(columns, rows, kDistanceWindow_px, distances, std::vector<float>(pixels, 1));
    for (size_t p = 0; p < pixels; ++p) features[p].inverse_distance_1_m = distances[p];
  }
  filtered = noisy;
  PixelValues paraboloid = noisy;
  const FeatureFilter filter(noisy, features, image.count(kFilterable), options.filter_radius_px);
  const int tasks = (rows + kFilterRowsPerTask - 1) / kFilterRowsPerTask;
  SIGHTLINE_RETURN_IF_ERROR(ForEachTile(tasks, options.threads, progress, from, to, [&](int task) {
    filter.Rows(task * kFilterRowsPerTask, std::min(rows, (task + 1) * kFilterRowsPerTask),
                filtered, paraboloid);
  }));
  const int c = options.noise_channel, channels = options.channels;
  std::vector<float> noise(pixels), difference(pixels), bias2(pixels);
  for (size_t p = 0; p < pixels; ++p) {
    const float* a = filtered.At(p);
    const float* b = paraboloid.At(p);
    const float d0 = a[c] - b[c], d1 = a[channels + c] - b[channels + c];
    noise[p] = image.HalvesVariance(filtered, p);
    difference[p] = (d0 - d1) * (d0 - d1) / 4;
    bias2[p] = d0 * d1;
  }
  noise = WindowMeans(columns, rows, kErrorWindow_px, noise, counts);
  difference = WindowMeans(columns, rows, kBiasWindow_px, difference, counts);
  bias2 = WindowMeans(columns, rows, kBiasWindow_px, bias2, counts);
  error2.assign(pixels, 0);
  for (size_t p = 0; p < pixels; ++p) {
    if (counts[p] == 0) continue;
    const float b2 = std::max(bias2[p] - difference[p], 0.0F);
    const float share = difference[p] > 0 ? difference[p] / (difference[p] + b2) : 1;
    float* a = filtered.At(p);
    const float* b = paraboloid.At(p);
    for (int k = 0; k < image.stride(); ++k) a[k] = share * a[k] + (1 - share) * b[k];
    error2[p] = noise[p] + (1 - share) * (1 - share) * difference[p] + share * share * b2;
  }
  return absl::OkStatus();
}

// Pixels that see several surfaces: many samples of what they see, each given the filtered light of
// the nearest pixels that see the same surface alone. Samples without such a pixel are traced. Rows
// [first, end); `excess` is the variance the traced ones leave.
void ReconstructEdges(const PixelSample& sample, const AdaptiveOptions& options,
                      const std::vector<PixelFeatures>& features, int first_row, int end_row,
                      PixelValues& filtered, std::vector<float>& excess,
                      std::vector<int64_t>& rays) {
  constexpr int kLogSamples = 6, kReach_px = 3, kSide_px = 2 * kReach_px + 1;
  const int columns = filtered.columns_px, rows = filtered.rows_px, stride = filtered.stride;
  const int channels = options.channels;
  const uint64_t seed = DeriveSeed(options.seed, "edges");
  struct Neighbour {
    const PixelFeatures* features;
    const float* values;
    Eigen::Vector3f normal;
    float weight;
  };
  for (int i = first_row; i < end_row; ++i) {
    for (int j = 0; j < columns; ++j) {
      const size_t pixel = static_cast<size_t>(i) * columns + j;
      if (features[pixel].uniform) continue;
      std::array<Neighbour, size_t{kSide_px} * kSide_px> neighbours;
      int neighbour_count = 0;
      for (int y = std::max(i - kReach_px, 0); y <= std::min(i + kReach_px, rows - 1); ++y) {
        for (int x = std::max(j - kReach_px, 0); x <= std::min(j + kReach_px, columns - 1); ++x) {
          const size_t other = static_cast<size_t>(y) * columns + x;
          if (!features[other].uniform) continue;
          const auto square = static_cast<float>((x - j) * (x - j) + (y - i) * (y - i));
          neighbours[neighbour_count++] = {&features[other], filtered.At(other),
                                           features[other].normal.normalized(),
                                           1 / (square * square)};
        }
      }
      PixelSamples points(seed, j, i, kLogSamples);
      std::array<double, 16> sums = {};
      double traced = 0, traced_squares = 0;
      for (int s = 0; s < (1 << kLogSamples); ++s) {
        points.Start(s);
        SampleFeatures seen;
        rays[pixel] += sample(i, j, s & 1, kFilterable, points, {}, seen);
        if (!seen.surface) continue;
        std::array<float, 16> near = {};
        float weights = 0;
        for (int n = 0; n < neighbour_count; ++n) {
          const Neighbour& other = neighbours[n];
          if (other.features->material != seen.material ||
              !SameSurface(other.features->position_m, other.normal, seen.position_m, seen.normal,
                           seen.footprint_m)) {
            continue;
          }
          weights += other.weight;
          for (int c = 0; c < stride; ++c) near[c] += other.weight * other.values[c];
        }
        if (weights > 0) {
          for (int c = 0; c < stride; ++c) sums[c] += near[c] / weights;
          continue;
        }
        std::array<float, 16> own = {};
        points.Start(s);
        rays[pixel] +=
            sample(i, j, s & 1, kFilterable, points, std::span(own.data(), channels), seen);
        for (int c = 0; c < channels; ++c) {
          sums[c] += own[c];
          sums[channels + c] += own[c];
        }
        const double noise = own[options.noise_channel];
        traced += noise;
        traced_squares += noise * noise;
      }
      constexpr double kShare = 1.0 / (1 << kLogSamples);
      for (int c = 0; c < stride; ++c) filtered.At(pixel)[c] = static_cast<float>(sums[c] * kShare);
      excess[pixel] = static_cast<float>(std::max(traced_squares - traced * traced * kShare, 0.0) *
                                         kShare * kShare);
    }
  }
}

}  // namespace

bool SameSurface(const Eigen::Vector3f& position_m, const Eigen::Vector3f& normal,
                 const Eigen::Vector3f& other_m, const Eigen::Vector3f& other_normal,
                 float footprint_m) {
  constexpr float kLeastCosine = 0.998F, kPlane_px = 1;
  return normal.dot(other_normal) > kLeastCosine &&
         std::abs(normal.dot(other_m - position_m)) < kPlane_px * footprint_m;
}

absl::StatusOr<AdaptiveResult> SampleAdaptively(int columns, int rows,
                                                const AdaptiveOptions& options,
                                                const PixelSample& sample,
                                                const TransportProgress& progress, double from,
                                                double to) {
  SampledImage image(columns, rows, options, sample);
  const size_t pixels = image.pixels();
  const int channels = options.channels, noise = options.noise_channel;
  const auto at = [&](double fraction) { return from + (to - from) * fraction; };

  std::vector<uint32_t> list(pixels);
  {
    // Blocks of pixels, for the caches.
    constexpr int kBlock = 16;
    size_t k = 0;
    for (int bi = 0; bi < rows; bi += kBlock) {
      for (int bj = 0; bj < columns; bj += kBlock) {
        for (int i = bi; i < std::min(bi + kBlock, rows); ++i) {
          for (int j = bj; j < std::min(bj + kBlock, columns); ++j) {
            list[k++] = static_cast<uint32_t>(static_cast<size_t>(i) * columns + j);
          }
        }
      }
    }
  }
  std::vector<uint32_t> lists[2];
  int samples[2], taken[2] = {0, 0};
  for (int part = 0; part < 2; ++part) {
    samples[part] = options.first_samples_per_px[part];
    if (samples[part] > 0) lists[part] = list;
  }

  AdaptiveResult result;
  PixelValues means[2], filtered;
  std::vector<float> variance[2], error2;
  // The choice of pixels for further samples uses means over several pixels: a pixel's own variance
  // correlates with its own mean, and choosing by it would bias the image. Both are from the first
  // round: square error after the filter, and mean.
  std::vector<float> first_error2, first_mean;
  std::vector<float> uniform(pixels);
  absl::Status status;
  for (int round = 0; !lists[0].empty() || !lists[1].empty(); ++round) {
    const double start = round == 0 ? 0.0 : 1 - 0.6 * std::pow(0.7, round - 1);
    const double end = 1 - 0.6 * std::pow(0.7, round);
    for (int part = 0; part < 2; ++part) {
      if (!lists[part].empty()) {
        const double middle = (start + end) / 2;
        status = image.Sample(part, lists[part], samples[part], round, progress,
                              at((part == 0 ? start : middle) * 0.9),
                              at((part == 0 ? middle : end) * 0.9));
        if (!status.ok()) return status;
        taken[part] += samples[part];
        samples[part] = taken[part];
      }
      if (round == 0 || !lists[part].empty()) {
        means[part] = image.Means(part);
        variance[part] = UnfilteredVariance(image, part, means[part]);
      }
    }
    double image_mean = 0;
    const auto pixel_mean = [&](size_t p) {
      float sum = 0;
      for (const PixelValues& part : means) {
        sum += part.At(p)[noise] + part.At(p)[channels + noise];
      }
      return sum / 2;
    };
    for (size_t p = 0; p < pixels; ++p) image_mean += pixel_mean(p);
    image_mean /= static_cast<double>(pixels);
    if (round == 0 && options.filter) {
      status = Filter(image, means[1], options, progress, at(end * 0.9), at(end * 0.9), filtered,
                      error2);
      if (!status.ok()) return status;
      for (size_t p = 0; p < pixels; ++p) uniform[p] = image.features()[p].uniform ? 1.0F : 0.0F;
      first_error2 = WindowMeans(columns, rows, kErrorWindow_px, error2, uniform);
    }
    const std::vector<float> all(pixels, 1);
    if (round == 0) {
      first_mean.resize(pixels);
      for (size_t p = 0; p < pixels; ++p) first_mean[p] = pixel_mean(p);
      first_mean = WindowMeans(columns, rows, kErrorWindow_px, first_mean, all);
      if (!options.filter) {
        first_error2 = WindowMeans(columns, rows, kErrorWindow_px, variance[1], all);
      }
    }
    const auto spread = WindowMeans(columns, rows, kSpreadWindow_px, variance[0], all);
    const double left = static_cast<double>(options.first_samples_per_px[1]) / taken[1];
    for (int part = 0; part < 2; ++part) {
      std::vector<uint32_t> rest;
      for (const uint32_t p : lists[part]) {
        const double tolerance =
            options.noise_target_relative *
            std::max({double{first_mean[p]}, options.noise_floor_relative * image_mean,
                      options.noise_floor});
        const double errors2[2] = {spread[p],
                                   first_error2[p] > 0 ? first_error2[p] * left : variance[1][p]};
        if (errors2[0] + errors2[1] > tolerance * tolerance &&
            errors2[part] > tolerance * tolerance / 2) {
          rest.push_back(p);
        }
      }
      if (2 * taken[part] > options.max_samples_per_px) rest.clear();
      lists[part] = std::move(rest);
    }
  }

  std::vector<int64_t> edge_rays(pixels, 0);
  if (options.filter) {
    status = Filter(image, means[1], options, progress, at(0.9), at(0.95), filtered, error2);
    if (!status.ok()) return status;
    for (size_t p = 0; p < pixels; ++p) uniform[p] = image.features()[p].uniform ? 1.0F : 0.0F;
    const auto around = WindowMeans(columns, rows, kErrorWindow_px, error2, uniform);
    // Pixels at edges are made of filtered ones.
    std::vector<float> excess(pixels, 0);
    status = ForEachTile(rows, options.threads, progress, at(0.95), at(1), [&](int row) {
      ReconstructEdges(sample, options, image.features(), row, row + 1, filtered, excess,
                       edge_rays);
    });
    if (!status.ok()) return status;
    for (size_t p = 0; p < pixels; ++p) {
      if (uniform[p] == 0) error2[p] = around[p] + excess[p];
    }
    means[1] = std::move(filtered);
  } else {
    error2 = variance[1];
  }
  result.standard_error = Image<float>(columns, rows);
  for (size_t p = 0; p < pixels; ++p) {
    result.standard_error.values[p] = std::sqrt(variance[0][p] + error2[p]);
  }
  for (int part = 0; part < 2; ++part) {
    for (int c = 0; c < channels; ++c) {
      Image<float> mean(columns, rows);
      for (size_t p = 0; p < pixels; ++p) {
        const float* v = means[part].At(p);
        mean.values[p] = (v[c] + v[channels + c]) / 2;
      }
      (part == 0 ? result.unfiltered : result.filterable).push_back(std::move(mean));
    }
  }
  result.features = std::move(image.features());
  result.rays = image.rays();
  for (const int64_t r : edge_rays) result.rays += r;
  return result;
}

}  // namespace sightline
