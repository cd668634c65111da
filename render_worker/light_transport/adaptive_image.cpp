#include "render_worker/light_transport/adaptive_image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/random/counter_random.h"
#include "render_worker/light_transport/feature_filter.h"
#include "render_worker/light_transport/tiles.h"

namespace sightline {
namespace {

// Samples one task takes at most: some 10 ms, so that cancelling is quick.
constexpr int kSamplesPerTask = 4096;
constexpr int kGainWindow_px = 3;   // half width
constexpr int kErrorWindow_px = 4;  // half width
constexpr int kFilterRowsPerTask = 2;

// Mean over the window of half width `half` of `value(pixel)` where `use(pixel)`.
template <class Value>
float WindowMean(int columns, int rows, size_t pixel, int half, const Value& value) {
  const int i = static_cast<int>(pixel) / columns, j = static_cast<int>(pixel) % columns;
  float sum = 0;
  int count = 0;
  for (int y = std::max(i - half, 0); y <= std::min(i + half, rows - 1); ++y) {
    for (int x = std::max(j - half, 0); x <= std::min(j + half, columns - 1); ++x) {
      sum += value(static_cast<size_t>(y) * columns + x);
      ++count;
    }
  }
  return sum / static_cast<float>(count);
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
        count_(pixels_, 0),
        rays_(pixels_, 0),
        spread_(2 * pixels_, 0),
        features_(pixels_) {
    for (PixelValues* part : {&sums_[0], &sums_[1]}) {
      *part = {columns, rows, stride_, std::vector<float>(pixels_ * stride_, 0)};
    }
  }

  // Takes `samples` more in each pixel of the list.
  absl::Status Sample(const std::vector<uint32_t>& list, int samples, int round,
                      const TransportProgress& progress, double from, double to) {
    const int per_task = std::max(1, kSamplesPerTask / samples);
    const int tasks = static_cast<int>((list.size() + per_task - 1) / per_task);
    return ForEachTile(tasks, options_.threads, progress, from, to, [&](int task) {
      const size_t end = std::min(list.size(), static_cast<size_t>(task + 1) * per_task);
      for (size_t k = static_cast<size_t>(task) * per_task; k < end; ++k) {
        SamplePixel(list[k], samples, round);
      }
    });
  }

  // Means of the halves, part 0: unfiltered, 1: filterable.
  PixelValues Means(int part) const {
    PixelValues means = sums_[part];
    for (size_t p = 0; p < pixels_; ++p) {
      const float inverse = 2 / static_cast<float>(count_[p]);
      for (int c = 0; c < stride_; ++c) means.At(p)[c] *= inverse;
    }
    return means;
  }

  // Variance of a pixel's mean from the spread of its samples, as if they were independent.
  float SpreadVariance(int part, size_t p) const {
    const auto n = static_cast<float>(count_[p]);
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
  const std::vector<int>& count() const { return count_; }
  std::vector<PixelFeatures>& features() { return features_; }
  int64_t rays() const {
    int64_t total = 0;
    for (const int64_t r : rays_) total += r;
    return total;
  }

 private:
  void SamplePixel(uint32_t pixel, int samples, int round) {
    const int row = static_cast<int>(pixel) / columns_, column = static_cast<int>(pixel) % columns_;
    const int channels = options_.channels;
    std::array<float, 32> sums;
    PixelFeatures& mean = features_[pixel];
    const int half_samples = samples / 2;
    for (int half = 0; half < 2; ++half) {
      PixelSamples points(DeriveSeed(options_.seed, "halves", 2 * round + half), column, row,
                          std::bit_width(static_cast<unsigned>(half_samples)) - 1);
      for (int s = 0; s < half_samples; ++s) {
        points.Start(s);
        std::fill(sums.begin(), sums.begin() + 2 * channels, 0.0F);
        SampleFeatures features;
        rays_[pixel] +=
            sample_(row, column, half, points, std::span(sums.data(), 2 * channels), features);
        for (int part = 0; part < 2; ++part) {
          float* total = sums_[part].At(pixel) + half * channels;
          for (int c = 0; c < channels; ++c) total[c] += sums[part * channels + c];
          const float noise = sums[part * channels + options_.noise_channel];
          spread_[2 * pixel + part] += noise * noise;
        }
        mean.textured = mean.textured || features.textured;
        const int n = count_[pixel]++;
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
        mean.inverse_distance_1_m +=
            (features.inverse_distance_1_m - mean.inverse_distance_1_m) * weight;
      }
    }
  }

  int columns_, rows_;
  AdaptiveOptions options_;
  const PixelSample& sample_;
  size_t pixels_;
  int stride_;
  PixelValues sums_[2];  // half 0's channels, half 1's channels
  std::vector<int> count_;
  std::vector<int64_t> rays_;
  std::vector<float> spread_;  // sums of squares of the noise channel, both parts
  std::vector<PixelFeatures> features_;
};

absl::Status Filter(const SampledImage& image, const PixelValues& noisy,
                    const std::vector<PixelFeatures>& features, const AdaptiveOptions& options,
                    const TransportProgress& progress, double from, double to,
                    PixelValues& filtered) {
  filtered = noisy;
  const int tasks = (image.rows() + kFilterRowsPerTask - 1) / kFilterRowsPerTask;
  return ForEachTile(tasks, options.threads, progress, from, to, [&](int task) {
    FilterRows(noisy, features, image.count(), options.filter_radius_px, task * kFilterRowsPerTask,
               std::min(image.rows(), (task + 1) * kFilterRowsPerTask), filtered);
  });
}

// The distance of what lights the surface, averaged over neighbours: from one pixel's samples it
// would vary with their noise.
std::vector<PixelFeatures> SmoothDistances(const SampledImage& image,
                                           const std::vector<PixelFeatures>& features) {
  std::vector<PixelFeatures> smooth = features;
  for (size_t p = 0; p < image.pixels(); ++p) {
    smooth[p].inverse_distance_1_m = WindowMean(image.columns(), image.rows(), p, 2, [&](size_t q) {
      return features[q].inverse_distance_1_m;
    });
  }
  return smooth;
}

// Variance of every pixel's mean: the spread of its own samples, times what low-discrepancy points
// gain over independent ones, taken from the halves of the pixels around.
std::vector<float> UnfilteredVariance(const SampledImage& image, int part,
                                      const PixelValues& means) {
  std::vector<float> halves(image.pixels()), spread(image.pixels()), variance(image.pixels());
  for (size_t p = 0; p < image.pixels(); ++p) {
    halves[p] = image.HalvesVariance(means, p);
    spread[p] = image.SpreadVariance(part, p);
  }
  for (size_t p = 0; p < image.pixels(); ++p) {
    const float h = WindowMean(image.columns(), image.rows(), p, kGainWindow_px,
                               [&](size_t q) { return halves[q]; });
    const float s = WindowMean(image.columns(), image.rows(), p, kGainWindow_px,
                               [&](size_t q) { return spread[q]; });
    variance[p] = s > 0 ? spread[p] * std::clamp(h / s, 0.02F, 2.0F) : 0;
  }
  return variance;
}

// Pixels that see several surfaces: many samples of what they see, each given the filtered light of
// the nearest pixels that see the same surface alone. Samples without such a pixel are traced. Rows
// [first, end); `excess` is the variance the traced ones leave.
void ReconstructEdges(const PixelSample& sample, const AdaptiveOptions& options,
                      const std::vector<PixelFeatures>& features, int first_row, int end_row,
                      PixelValues& filtered, std::vector<float>& excess,
                      std::vector<int64_t>& rays) {
  constexpr int kLogSamples = 6, kReach_px = 3;
  const int columns = filtered.columns_px, rows = filtered.rows_px, stride = filtered.stride;
  const int channels = options.channels;
  const uint64_t seed = DeriveSeed(options.seed, "edges");
  for (int i = first_row; i < end_row; ++i) {
    for (int j = 0; j < columns; ++j) {
      const size_t pixel = static_cast<size_t>(i) * columns + j;
      if (features[pixel].uniform) continue;
      PixelSamples points(seed, j, i, kLogSamples);
      std::array<double, 32> sums = {};
      double traced = 0, traced_squares = 0;
      for (int s = 0; s < (1 << kLogSamples); ++s) {
        points.Start(s);
        SampleFeatures seen;
        rays[pixel] += sample(i, j, s & 1, points, {}, seen);
        if (!seen.surface) continue;
        std::array<float, 32> near = {};
        float weights = 0;
        for (int y = std::max(i - kReach_px, 0); y <= std::min(i + kReach_px, rows - 1); ++y) {
          for (int x = std::max(j - kReach_px, 0); x <= std::min(j + kReach_px, columns - 1); ++x) {
            const size_t other = static_cast<size_t>(y) * columns + x;
            const PixelFeatures& f = features[other];
            if (!f.uniform || f.material != seen.material ||
                !SameSurface(f.position_m, f.normal.normalized(), seen.position_m, seen.normal,
                             seen.footprint_m)) {
              continue;
            }
            const auto square = static_cast<float>((x - j) * (x - j) + (y - i) * (y - i));
            const float w = 1 / (square * square);
            weights += w;
            for (int c = 0; c < stride; ++c) near[c] += w * filtered.At(other)[c];
          }
        }
        if (weights > 0) {
          for (int c = 0; c < stride; ++c) sums[c] += near[c] / weights;
          continue;
        }
        std::array<float, 32> own = {};
        points.Start(s);
        rays[pixel] += sample(i, j, s & 1, points, std::span(own.data(), 2 * channels), seen);
        for (int c = 0; c < channels; ++c) {
          sums[c] += own[channels + c];
          sums[channels + c] += own[channels + c];
        }
        const double noise = own[channels + options.noise_channel];
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
  const std::vector<uint32_t> all = list;

  AdaptiveResult result;
  PixelValues means[2], filtered;
  std::vector<float> filter_gain(pixels, 1);  // variance after the filter over before
  std::vector<float> variance[2];
  // Filters part 1 of the means, then the pixels at edges from the filtered ones.
  std::vector<float> excess(pixels, 0);
  std::vector<int64_t> edge_rays(pixels, 0);
  const auto filter = [&](double start, double end) -> absl::Status {
    const auto smooth = SmoothDistances(image, image.features());
    absl::Status status =
        Filter(image, means[1], smooth, options, progress, start, (start + end) / 2, filtered);
    if (!status.ok()) return status;
    return ForEachTile(rows, options.threads, progress, (start + end) / 2, end, [&](int row) {
      ReconstructEdges(sample, options, smooth, row, row + 1, filtered, excess, edge_rays);
    });
  };

  int samples = options.first_samples_per_px;
  int taken = 0;
  absl::Status status;
  for (int round = 0; !list.empty(); ++round) {
    const double start = round == 0 ? 0.0 : 1 - 0.6 * std::pow(0.7, round - 1);
    const double end = 1 - 0.6 * std::pow(0.7, round);
    status = image.Sample(list, samples, round, progress, at(start * 0.9), at(end * 0.9));
    if (!status.ok()) return status;
    taken += samples;
    samples = taken;
    for (int part = 0; part < 2; ++part) {
      means[part] = image.Means(part);
      variance[part] = UnfilteredVariance(image, part, means[part]);
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
      status = filter(at(end * 0.9), at(end * 0.9));
      if (!status.ok()) return status;
      for (size_t p = 0; p < pixels; ++p) {
        const float after = WindowMean(columns, rows, p, kErrorWindow_px,
                                       [&](size_t q) { return image.HalvesVariance(filtered, q); });
        const float before =
            WindowMean(columns, rows, p, kErrorWindow_px, [&](size_t q) { return variance[1][q]; });
        filter_gain[p] = before > 0 ? std::min(after / before, 1.0F) : 1;
      }
    }
    if (2 * taken > options.max_samples_per_px) break;
    std::vector<uint32_t> rest;
    for (const uint32_t p : list) {
      const double tolerance =
          options.noise_target_relative *
          std::max<double>(pixel_mean(p), options.noise_floor_relative * image_mean);
      if (variance[0][p] + variance[1][p] * filter_gain[p] > tolerance * tolerance) {
        rest.push_back(p);
      }
    }
    list = std::move(rest);
  }

  if (options.filter) {
    status = filter(at(0.9), at(1));
    if (!status.ok()) return status;
    means[1] = std::move(filtered);
  }
  result.standard_error = Image<float>(columns, rows);
  for (size_t p = 0; p < pixels; ++p) {
    result.standard_error.values[p] = std::sqrt(variance[0][p] + variance[1][p] * filter_gain[p]);
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
