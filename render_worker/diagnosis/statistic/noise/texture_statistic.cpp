// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/noise/texture_statistic.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "render_worker/diagnosis/statistic/noise/bin_moments.h"
#include "render_worker/diagnosis/statistic/noise/expected_texture.h"
#include "render_worker/recordings/strips.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Errors of the model of the line's speckle: of the squared contrast (relative) and of the
// correlations of neighbours. Measured: root mean square over ten conditions compared with rendered
// frames (f/2.8 to f/16, in focus and not, lines narrower and wider than the Airy pattern).
constexpr double kContrastError = 0.02;
constexpr double kCorrelationError = 0.02;
// Squared relative error of the variance that speckle adds to the background. Chosen: the
// statistics of speckle far from the line are known to about half of it.
constexpr double kSquaredBackgroundError = 0.25;
// Half-width of the core [nominal widths of the line]. Chosen: it contains the line's crest, and
// kMiddle selects the bins that count.
constexpr double kCoreWidths = 1.2;
// Bins of the core brighter than this fraction of its brightest bin count. Chosen: half maximum.
constexpr double kMiddle = 0.5;
// Brightness of the brightest bin of a usable core, relative to the largest raw value. Chosen:
// above noise, and low enough that few speckles saturate (an intensity exceeds 2.5 times the mean
// of fully developed speckle with a probability of 8 %).
constexpr double kDimmest = 0.03, kBrightest = 0.4;
// A background bin needs more rows than this for a variance. Chosen.
constexpr size_t kFewRows = 8;
// Columns and speckle levels of the sample that a planned recording is judged by. Chosen: its mean
// suffices.
constexpr int kPlannedColumns_px = 2, kPlannedLevels = 4;
// Bound on the correlation of the contrasts of two planes, which keeps the covariance positive
// definite.
constexpr double kMostPlaneCorrelation = 0.9;
// Variance of a sample correlation times the number of independent pixels. Chosen: it is 1 for
// uncorrelated normal residuals, and speckle's distribution has heavier tails.
constexpr double kCorrelationSpread = 1.5;

// Residuals of one plane's pixels in a row about the means of their segments.
std::vector<double> RowResiduals(const Image<uint16_t>& raw, const PixelPlane& plane, int row,
                                 int segments) {
  std::vector<double> residuals;
  for (int segment = 0; segment < segments; ++segment) {
    const auto [first, last] = BlockColumns(raw.columns_px, segments, segment);
    const size_t start = residuals.size();
    double sum = 0;
    for (int c = first + plane.first_column; c < last; c += plane.step) {
      residuals.push_back(raw.At(row, c));
      sum += raw.At(row, c);
    }
    const double mean = sum / static_cast<double>(residuals.size() - start);
    for (size_t i = start; i < residuals.size(); ++i) residuals[i] -= mean;
  }
  return residuals;
}

double MeanSquare(const std::vector<double>& values) {
  double sum = 0;
  for (double value : values) sum += value * value;
  return sum / static_cast<double>(values.size());
}

// Correlation of two rows' residuals, `lag` samples apart.
double Correlation(const std::vector<double>& a, const std::vector<double>& b, int lag) {
  const double scale = std::sqrt(MeanSquare(a) * MeanSquare(b));
  if (scale == 0) return 0;
  double sum = 0;
  const size_t count = a.size() - lag;
  for (size_t i = 0; i < count; ++i) sum += a[i] * b[i + lag];
  return sum / (static_cast<double>(count) * scale);
}

CoreSums ObserveCore(const Image<uint16_t>& raw, const std::vector<PixelPlane>& planes,
                     const std::vector<ProfileBin>& core, int segments, double black_dn) {
  CoreSums sums;
  for (const ProfileBin& bin : core) {
    const PixelPlane& plane = planes[bin.plane];
    const double signal = MeanOfBin(raw, plane, bin) - black_dn;
    sums.square += signal * signal * static_cast<double>(bin.rows.size());
    for (int row : bin.rows) {
      const std::vector<double> here = RowResiduals(raw, plane, row, segments);
      sums.variance += MeanSquare(here);
      ++sums.rows;
      for (int lag = 1; lag <= kCorrelationLags; ++lag) {
        const int other = OtherRow(row, lag * plane.step, raw.rows_px);
        sums.correlations[2 * lag - 2] += Correlation(here, here, lag);
        sums.correlations[2 * lag - 1] +=
            Correlation(here, RowResiduals(raw, plane, other, segments), 0);
      }
    }
  }
  return sums;
}

// How much of a core's variance is speckle, and where the core is.
struct CoreShare {
  double rows = 0;
  double speckle = 0;  // fraction of the variance
  int middle_row = 0;
};

CoreShare ShareOfCore(const ExpectedSet& expected, int frame, const std::vector<PixelPlane>& planes,
                      const std::vector<ProfileBin>& core) {
  double level = 0, noise = 0, rows = 0, middle = 0;
  for (const ProfileBin& bin : core) {
    for (int row : bin.rows) {
      for (const std::vector<ExpectedFrame>& samples : expected.strips) {
        level += samples[frame].level_variance_dn2.At(row, planes[bin.plane].first_column);
        noise += PixelVariance(samples[frame], row, planes[bin.plane]);
      }
      middle += row;
      ++rows;
    }
  }
  return {rows, level / (level + noise), static_cast<int>(std::lround(middle / rows))};
}

// Sum of squared correlations of a pixel with all others of the core: the number of pixels that
// count as one in the variance of a mean square.
double SumOfSquaredCorrelations(const SpecklePixelCovariance& speckle, const CoreShare& core,
                                int step) {
  double correlated = 0;
  for (int dr = -speckle.max_lag(); dr <= speckle.max_lag(); ++dr) {
    const double both = 1 - std::abs(dr) / core.rows;
    if (both <= 0) continue;
    for (int dc = -speckle.max_lag(); dc <= speckle.max_lag(); ++dc) {
      const double r = speckle.At(dr * step, dc * step) / speckle.At(0, 0);
      correlated += dr == 0 && dc == 0 ? 1 : both * core.speckle * core.speckle * r * r;
    }
  }
  return correlated;
}

// Mean speckle variance of a background bin [DN^2].
double SpeckleVarianceOf(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                         const ProfileBin& bin) {
  double level = 0;
  for (int row : bin.rows) {
    for (const std::vector<ExpectedFrame>& samples : expected.strips) {
      level += samples[frame].level_variance_dn2.At(row, plane.first_column) /
               static_cast<double>(expected.strips.size() * bin.rows.size());
    }
  }
  return level;
}

}  // namespace

TextureStatistic::TextureStatistic(const RecordedSet& set, int segments_along_line)
    : segments_(segments_along_line),
      planes_(PixelPlanes(set.frames.front().nominal.sensor)),
      nominal_sensor_(set.frames.front().nominal.sensor) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    if (recorded.plate_position_id >= 0) {
      blocks_.push_back(MakeBlock(recorded, static_cast<int>(f)));
    }
  }
  for (Block& block : blocks_) {
    const RecordedFrame& own = set.frames[block.frames.front()];
    block.sharing =
        static_cast<int>(std::count_if(blocks_.begin(), blocks_.end(), [&](const Block& other) {
          return !other.cores.empty() && SameSpeckle(own, set.frames[other.frames.front()]);
        }));
    block.sharing = std::max(1, block.sharing);
  }
}

TextureStatistic::Block TextureStatistic::MakeBlock(const RecordedFrame& recorded,
                                                    int frame) const {
  Block block;
  block.frames = {frame};
  block.columns_px = recorded.nominal.roi.columns_px;
  const double width_px = NominalWidthPx(recorded.nominal);
  Bins backgrounds(planes_.size());
  std::vector<Bins> cores(planes_.size());
  for (ProfileBin& bin : MakeProfileBins(recorded, planes_)) {
    const double distance_px = std::abs(bin.centre_px);
    if (distance_px > UnlitDistancePx(recorded.nominal)) {
      ProfileBin& far = backgrounds[bin.plane];
      far.plane = bin.plane;
      far.rows.insert(far.rows.end(), bin.rows.begin(), bin.rows.end());
    } else if (distance_px < kCoreWidths * width_px + planes_[bin.plane].step) {
      cores[bin.plane].push_back(std::move(bin));
    }
  }
  for (ProfileBin& far : backgrounds) {
    if (far.rows.size() > kFewRows) block.backgrounds.push_back(std::move(far));
  }
  // A planned recording is judged by its expected brightness.
  const bool planned = recorded.raw_dn.values.empty();
  FrameSetup sample = recorded.nominal;
  sample.roi = StripRegion(sample.roi, 1, 0, kPlannedColumns_px);
  const ExpectedFrame nominal =
      planned ? ExpectFrame(sample, {}, nullptr, nullptr, kPlannedLevels) : ExpectedFrame{};
  for (Bins& bins : cores) {
    Bins core = CoreOf(recorded, planned ? &nominal : nullptr, std::move(bins));
    if (!core.empty()) block.cores.push_back(std::move(core));
  }
  return block;
}

// The bright bins of one plane's core; empty: too dim or too bright. `nominal`: the expected frame
// of a planned recording, or null.
TextureStatistic::Bins TextureStatistic::CoreOf(const RecordedFrame& recorded,
                                                const ExpectedFrame* nominal, Bins bins) const {
  std::vector<double> means;
  for (const ProfileBin& bin : bins) {
    const PixelPlane& plane = planes_[bin.plane];
    means.push_back(nominal != nullptr
                        ? nominal->MeanDn(bin.rows[bin.rows.size() / 2], plane.first_column)
                        : MeanOfBin(recorded.raw_dn, plane, bin));
  }
  const double brightest = means.empty() ? 0 : *std::max_element(means.begin(), means.end());
  const double top = recorded.nominal.sensor.largest_dn();
  if (brightest < kDimmest * top || brightest > kBrightest * top) return {};
  Bins core;
  for (size_t b = 0; b < bins.size(); ++b) {
    if (means[b] > kMiddle * brightest) core.push_back(std::move(bins[b]));
  }
  return core;
}

Eigen::VectorXd TextureStatistic::Observed(const RecordedSet& set, int index) const {
  const Block& block = blocks_[index];
  const RecordedFrame& recorded = set.frames[block.frames.front()];
  const Image<uint16_t>& raw = recorded.raw_dn;
  const double black_dn = DarkMeanDn(recorded.nominal.sensor);
  Eigen::VectorXd values(block.backgrounds.size() + kCoreValues * block.cores.size());
  int at = 0;
  for (const ProfileBin& bin : block.backgrounds) {
    double sum = 0;
    for (int row : bin.rows) {
      sum += MeanSquare(RowResiduals(raw, planes_[bin.plane], row, segments_));
    }
    values[at++] = sum / static_cast<double>(bin.rows.size());
  }
  for (const Bins& core : block.cores) {
    const CoreSums sums = ObserveCore(raw, planes_, core, segments_, black_dn);
    values[at++] = sums.SquaredContrast();
    for (double correlation : sums.correlations) values[at++] = correlation / sums.rows;
  }
  return values;
}

Eigen::VectorXd TextureStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const int segments = static_cast<int>(expected.strips.size());
  const int step = planes_.front().step;
  const int columns = block.columns_px / segments / step;
  const ExpectedTexture texture(expected, block.frames.front(), columns, step,
                                DarkMeanDn(nominal_sensor_));
  Eigen::VectorXd values(block.backgrounds.size() + kCoreValues * block.cores.size());
  int at = 0;
  for (const ProfileBin& bin : block.backgrounds) {
    values[at++] = texture.BackgroundVariance(planes_[bin.plane], bin);
  }
  for (const Bins& core : block.cores) {
    const CoreSums sums = texture.Core(planes_, core);
    values[at++] = sums.SquaredContrast() * (1 + expected.model_error.Of(ModelError::kContrast));
    for (double correlation : sums.correlations) values[at++] = correlation / sums.rows;
  }
  return values;
}

Eigen::MatrixXd TextureStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const int f = block.frames.front();
  const ExpectedFrame& front = expected.strips.front()[f];
  const Eigen::VectorXd values = Expected(expected, index);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(values.size(), values.size());
  const int step = planes_.front().step;
  const double columns = static_cast<double>(block.columns_px) / step;
  int at = 0;
  for (const ProfileBin& bin : block.backgrounds) {
    const double level = SpeckleVarianceOf(expected, f, planes_[bin.plane], bin);
    const double count = columns * static_cast<double>(bin.rows.size());
    const double kurtosis = MeanExcessKurtosis(expected, f, planes_[bin.plane], bin);
    covariance(at, at) =
        (2 + kurtosis) * values[at] * values[at] / count + kSquaredBackgroundError * level * level;
    ++at;
  }
  std::vector<double> contrast_errors, speckle_shares;
  for (const Bins& bins : block.cores) {
    const CoreShare core = ShareOfCore(expected, f, planes_, bins);
    const double share = core.speckle;
    const SpecklePixelCovariance& speckle = front.SpeckleAt(core.middle_row);
    const double correlated = SumOfSquaredCorrelations(speckle, core, step);
    // A variance of n pixels has a relative variance of (2 + excess kurtosis) / n. The excess
    // kurtosis of a Gamma distribution of M degrees of freedom is 6 / M.
    const double spread = 2 + 6 * speckle.At(0, 0) * share * share;
    const double count = columns * core.rows;
    const double of_one = correlated / count * block.sharing;
    contrast_errors.push_back(values[at] * std::sqrt(spread * of_one));
    speckle_shares.push_back(share);
    covariance(at, at) =
        std::pow(contrast_errors.back(), 2) + std::pow(kContrastError * values[at], 2);
    ++at;
    const double error = std::hypot(std::sqrt(kCorrelationSpread * of_one), kCorrelationError);
    for (int i = 0; i < 2 * kCorrelationLags; ++i, ++at) covariance(at, at) = error * error;
  }
  // Planes see the same speckle where it is larger than a pixel.
  const int first = static_cast<int>(block.backgrounds.size());
  for (size_t a = 0; a < block.cores.size(); ++a) {
    for (size_t b = 0; b < block.cores.size(); ++b) {
      if (a == b) continue;
      const SpecklePixelCovariance& speckle = front.SpeckleAt(block.cores[a].front().rows.front());
      const double r = speckle.At(0, 1) / speckle.At(0, 0);
      covariance(first + kCoreValues * static_cast<int>(a),
                 first + kCoreValues * static_cast<int>(b)) =
          std::min(kMostPlaneCorrelation, r * r * speckle_shares[a] * speckle_shares[b]) *
          contrast_errors[a] * contrast_errors[b];
    }
  }
  return covariance;
}

}  // namespace sightline
