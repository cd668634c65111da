// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/noise_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "render_worker/diagnosis/statistic/shared_speckle_statistic.h"
#include "render_worker/recordings/strips.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

constexpr int kCorrelationLags = 2;
constexpr int kCoreValues = 1 + 2 * kCorrelationLags;
// Errors that the model of the line's speckle makes, about the root mean square over ten conditions
// compared with rendered frames (f/2.8 to f/16, in focus and not, lines narrower and wider than the
// Airy pattern): of the squared contrast (relative), of the correlations of neighbours.
constexpr double kContrastError = 0.02;
constexpr double kCorrelationError = 0.02;
// Repeats: of the largest number, below which no speckle is cut off.
constexpr double kLinear = 0.8;
// Of the variance, by a mean that is not the expected one: the model is far off there.
constexpr double kMostChange = 0.5;
// Of what speckle that has moved adds to the variance between repeats.
constexpr double kMovedSpeckleError = 0.2;

double NoiseVariance(const ExpectedFrame& strip, int row, int column) {
  return strip.noise_variance_dn2.At(row, column) + strip.pattern_variance_dn2.At(row, column);
}

// Mean over the rows of a bin, of all strips.
double MeanExcessKurtosis(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                          const ProfileBin& bin) {
  double sum = 0;
  for (const std::vector<ExpectedFrame>& strips : expected.strips) {
    for (int row : bin.rows) sum += strips[frame].NoiseExcessKurtosis(row, plane.first_column);
  }
  return sum / static_cast<double>(bin.rows.size() * expected.strips.size());
}

// Sum over a block's columns of the speckle correlation with one of them, over their number: share
// of the variance that the mean of the block takes with it.
double MeanShare(const SpecklePixelCovariance& speckle, int columns, int step) {
  return CovarianceOfMeans(speckle, 0, columns, step, 0) / speckle.At(0, 0);
}

// Residuals of one plane's row about the means of its blocks.
std::vector<double> RowResiduals(const Image<uint16_t>& raw, const PixelPlane& plane, int row,
                                 int blocks) {
  std::vector<double> residuals;
  for (int block = 0; block < blocks; ++block) {
    const auto [first, last] = BlockColumns(raw.columns_px, blocks, block);
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

double MeanOf(const Image<uint16_t>& raw, const PixelPlane& plane, const ProfileBin& bin) {
  double sum = 0, count = 0;
  for (int row : bin.rows) {
    for (int c = plane.first_column; c < raw.columns_px; c += plane.step) {
      sum += raw.At(row, c);
      ++count;
    }
  }
  return sum / count;
}

// Relative variance of the laser light along the block of a strip.
double VarianceAlongLine(const ExpectedFrame& strip) {
  double sum = 0;
  for (double level : strip.level_along_line) sum += (level - 1) * (level - 1);
  const double known = strip.level_along_line.empty() ? 0 : sum / strip.level_along_line.size();
  return known + strip.drawn_variance_along_line;
}

// A factor between two recordings (of their amount of light), by least squares over the pixels that
// are not near saturation. It is taken off, so that it is no noise.
class CommonFactor {
 public:
  CommonFactor(double black_dn, double top_dn) : black_dn_(black_dn), top_dn_(top_dn) {}
  void Add(double a, double b) {
    if (a > top_dn_ || b > top_dn_) return;
    const double signal = 0.5 * (a + b) - black_dn_;
    product_ += (a - b) * signal;
    square_ += signal * signal;
  }
  double Difference(double a, double b) const {
    const double factor = square_ > 0 ? product_ / square_ : 0;
    return a - b - factor * (0.5 * (a + b) - black_dn_);
  }

 private:
  double black_dn_, top_dn_;
  double product_ = 0, square_ = 0;
};

int OtherRow(int row, int lag, int rows_px) { return row + lag < rows_px ? row + lag : row - lag; }

// Mean product of two rows' standardised residuals, `lag` samples apart.
double Correlation(const std::vector<double>& a, const std::vector<double>& b, int lag) {
  const double scale = std::sqrt(MeanSquare(a) * MeanSquare(b));
  if (scale == 0) return 0;
  double sum = 0;
  const size_t count = a.size() - lag;
  for (size_t i = 0; i < count; ++i) sum += a[i] * b[i + lag];
  return sum / (static_cast<double>(count) * scale);
}

}  // namespace

TextureStatistic::TextureStatistic(const RecordedSet& set, int blocks_along_line)
    : blocks_(blocks_along_line),
      planes_(PixelPlanes(set.frames.front().nominal.sensor)),
      nominal_sensor_(set.frames.front().nominal.sensor) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    if (recorded.plate_position_id < 0) continue;
    Entry entry;
    entry.frames = {static_cast<int>(f)};
    entry.columns_px = recorded.nominal.roi.columns_px;
    const double width_px = NominalWidthPx(recorded.nominal);
    const double top = recorded.nominal.sensor.largest_dn();
    std::vector<ProfileBin> backgrounds(planes_.size());
    std::vector<std::vector<ProfileBin>> cores(planes_.size());
    for (ProfileBin& bin : MakeProfileBins(recorded, planes_)) {
      const double distance_px = std::abs(bin.centre_px);
      if (distance_px > UnlitDistancePx(recorded.nominal)) {
        ProfileBin& far = backgrounds[bin.plane];
        far.plane = bin.plane;
        far.rows.insert(far.rows.end(), bin.rows.begin(), bin.rows.end());
      } else if (distance_px < 1.2 * width_px + planes_[bin.plane].step) {
        cores[bin.plane].push_back(std::move(bin));
      }
    }
    for (ProfileBin& far : backgrounds) {
      if (far.rows.size() > 8) entry.backgrounds.push_back(std::move(far));
    }
    // A planned recording is as bright as it should be.
    const bool planned = recorded.raw_dn.values.empty();
    FrameSetup strip = recorded.nominal;
    strip.roi = StripRegion(strip.roi, 1, 0, 2);
    const ExpectedFrame nominal =
        planned ? ExpectFrame(strip, {}, nullptr, nullptr, 4) : ExpectedFrame{};
    for (std::vector<ProfileBin>& core : cores) {
      std::vector<double> means;
      for (const ProfileBin& bin : core) {
        const PixelPlane& plane = planes_[bin.plane];
        means.push_back(planned ? nominal.MeanDn(bin.rows[bin.rows.size() / 2], plane.first_column)
                                : MeanOf(recorded.raw_dn, plane, bin));
      }
      const double brightest = means.empty() ? 0 : *std::max_element(means.begin(), means.end());
      if (brightest < 0.03 * top || brightest > 0.4 * top) continue;
      std::vector<ProfileBin> middle;
      for (size_t b = 0; b < core.size(); ++b) {
        if (means[b] > 0.5 * brightest) middle.push_back(std::move(core[b]));
      }
      entry.cores.push_back(std::move(middle));
    }
    entries_.push_back(std::move(entry));
  }
  for (Entry& entry : entries_) {
    const RecordedFrame& own = set.frames[entry.frames.front()];
    entry.sharing =
        static_cast<int>(std::count_if(entries_.begin(), entries_.end(), [&](const Entry& other) {
          return !other.cores.empty() && SameSpeckle(own, set.frames[other.frames.front()]);
        }));
    entry.sharing = std::max(1, entry.sharing);
  }
}

Eigen::VectorXd TextureStatistic::Observed(const RecordedSet& set, int index) const {
  const Entry& entry = entries_[index];
  const RecordedFrame& recorded = set.frames[entry.frames.front()];
  const Image<uint16_t>& raw = recorded.raw_dn;
  const double black_dn = DarkMeanDn(recorded.nominal.sensor);
  Eigen::VectorXd values(entry.backgrounds.size() + kCoreValues * entry.cores.size());
  int at = 0;
  for (const ProfileBin& bin : entry.backgrounds) {
    double sum = 0;
    for (int row : bin.rows) sum += MeanSquare(RowResiduals(raw, planes_[bin.plane], row, blocks_));
    values[at++] = sum / static_cast<double>(bin.rows.size());
  }
  for (const std::vector<ProfileBin>& core : entry.cores) {
    double variance = 0, square = 0, rows = 0;
    std::array<double, size_t{2} * kCorrelationLags> correlations{};
    for (const ProfileBin& bin : core) {
      const PixelPlane& plane = planes_[bin.plane];
      const double signal = MeanOf(raw, plane, bin) - black_dn;
      square += signal * signal * static_cast<double>(bin.rows.size());
      for (int row : bin.rows) {
        const std::vector<double> here = RowResiduals(raw, plane, row, blocks_);
        variance += MeanSquare(here);
        ++rows;
        for (int lag = 1; lag <= kCorrelationLags; ++lag) {
          const int other = OtherRow(row, lag * plane.step, raw.rows_px);
          correlations[2 * lag - 2] += Correlation(here, here, lag);
          correlations[2 * lag - 1] +=
              Correlation(here, RowResiduals(raw, plane, other, blocks_), 0);
        }
      }
    }
    values[at++] = variance / square;
    for (double correlation : correlations) values[at++] = correlation / rows;
  }
  return values;
}

Eigen::VectorXd TextureStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const int f = entry.frames.front();
  const ExpectedFrame& front = expected.strips.front()[f];
  const int blocks = static_cast<int>(expected.strips.size());
  const int step = planes_.front().step;
  const int columns = entry.columns_px / blocks / step;
  const int rows_px = front.noise_variance_dn2.rows_px;
  const double black_dn = DarkMeanDn(nominal_sensor_);
  const bool lit = front.speckle != nullptr;
  std::vector<double> shares;  // by place across the line
  for (int place = 0; lit && place < front.speckle->places(); ++place) {
    shares.push_back(MeanShare(front.speckle->At(place), columns, step));
  }
  const auto share_of = [&](int row) {
    return lit ? shares[front.speckle->PlaceOf((front.frame.roi.row_px + row) *
                                               front.frame.sensor.pixel_pitch_m)]
               : 0;
  };
  struct Row {
    double level = 0, noise = 0, signal = 0;
    double along = 0;  // variance of what differs slowly along the line
  };
  const auto row_of = [&](const PixelPlane& plane, int row) {
    Row sum;
    for (const std::vector<ExpectedFrame>& strips : expected.strips) {
      const double along = VarianceAlongLine(strips[f]);
      const double signal = strips[f].MeanDn(row, plane.first_column) - black_dn;
      // Squared speckle is brighter on average where the light differs.
      sum.level += (1 + along) * strips[f].level_variance_dn2.At(row, plane.first_column) / blocks;
      sum.noise += NoiseVariance(strips[f], row, plane.first_column) / blocks;
      sum.signal += signal / blocks;
      sum.along += along * signal * signal / blocks;
    }
    return sum;
  };
  Eigen::VectorXd values(entry.backgrounds.size() + kCoreValues * entry.cores.size());
  int at = 0;
  for (const ProfileBin& bin : entry.backgrounds) {
    double sum = 0;
    for (int row : bin.rows) {
      const Row here = row_of(planes_[bin.plane], row);
      sum += here.level * (1 - share_of(row)) + here.noise * (1 - 1.0 / columns);
    }
    values[at++] = sum / static_cast<double>(bin.rows.size());
  }
  for (const std::vector<ProfileBin>& core : entry.cores) {
    double variance = 0, square = 0, rows = 0;
    std::array<double, size_t{2} * kCorrelationLags> correlations{};
    for (const ProfileBin& bin : core) {
      const PixelPlane& plane = planes_[bin.plane];
      double signal = 0;
      for (int row : bin.rows) {
        const Row row_here = row_of(plane, row);
        const SpecklePixelCovariance& speckle = front.SpeckleAt(row, plane.first_column);
        const double one = speckle.At(0, 0), share = share_of(row);
        const double here =
            row_here.level * (1 - share) + row_here.noise * (1 - 1.0 / columns) + row_here.along;
        variance += here;
        signal += row_here.signal;
        ++rows;
        for (int lag = 1; lag <= kCorrelationLags; ++lag) {
          const int other = OtherRow(row, lag * step, rows_px);
          const Row row_there = row_of(plane, other);
          const double there = row_there.level * (1 - share_of(other)) +
                               row_there.noise * (1 - 1.0 / columns) + row_there.along;
          correlations[2 * lag - 2] += (row_here.level * (speckle.At(0, lag * step) / one - share) -
                                        row_here.noise / columns + row_here.along) /
                                       here;
          // Of two rows: about the place between them.
          const SpecklePixelCovariance& between =
              front.SpeckleAt(step > 1 ? row : (row + other) / 2, plane.first_column);
          const double both = std::sqrt(one * front.SpeckleAt(other, plane.first_column).At(0, 0));
          double row_share = 0;
          for (int c = -columns + 1; c < columns; ++c) {
            row_share += (1 - std::abs(c) / static_cast<double>(columns)) *
                         between.At(lag * step, c * step) / (both * columns);
          }
          correlations[2 * lag - 1] += (std::sqrt(row_here.level * row_there.level) *
                                            (between.At(lag * step, 0) / both - row_share) +
                                        std::sqrt(row_here.along * row_there.along)) /
                                       std::sqrt(here * there);
        }
      }
      const double count = static_cast<double>(bin.rows.size());
      square += signal * signal / count;
    }
    values[at++] = variance / square * (1 + expected.model_error.Of(ModelError::kContrast));
    for (double correlation : correlations) values[at++] = correlation / rows;
  }
  return values;
}

Eigen::MatrixXd TextureStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const int f = entry.frames.front();
  const ExpectedFrame& front = expected.strips.front()[f];
  const Eigen::VectorXd values = Expected(expected, index);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(values.size(), values.size());
  const int step = planes_.front().step;
  const double columns = static_cast<double>(entry.columns_px) / step;
  int at = 0;
  // A tenth of what speckle adds to the background's variance: its statistics there are not known
  // better.
  for (const ProfileBin& bin : entry.backgrounds) {
    double level = 0;
    for (int row : bin.rows) {
      for (const std::vector<ExpectedFrame>& strips : expected.strips) {
        level += strips[f].level_variance_dn2.At(row, planes_[bin.plane].first_column) /
                 static_cast<double>(expected.strips.size() * bin.rows.size());
      }
    }
    const double count = columns * static_cast<double>(bin.rows.size());
    const double kurtosis = MeanExcessKurtosis(expected, f, planes_[bin.plane], bin);
    covariance(at, at) = (2 + kurtosis) * values[at] * values[at] / count + 0.25 * level * level;
    ++at;
  }
  std::vector<double> contrast_errors;
  std::vector<double> middles;
  for (const std::vector<ProfileBin>& core : entry.cores) {
    double level = 0, noise = 0, rows = 0, middle = 0;
    for (const ProfileBin& bin : core) {
      for (int row : bin.rows) {
        for (const std::vector<ExpectedFrame>& strips : expected.strips) {
          level += strips[f].level_variance_dn2.At(row, planes_[bin.plane].first_column);
          noise += NoiseVariance(strips[f], row, planes_[bin.plane].first_column);
        }
        middle += row;
        ++rows;
      }
    }
    const double share = level / (level + noise);
    const SpecklePixelCovariance& speckle =
        front.SpeckleAt(static_cast<int>(std::lround(middle / rows)));
    // Sum of squared correlations over the rows and columns of the middle.
    double correlated = 0;
    for (int dr = -speckle.max_lag(); dr <= speckle.max_lag(); ++dr) {
      const double both = 1 - std::abs(dr) / rows;
      if (both <= 0) continue;
      for (int dc = -speckle.max_lag(); dc <= speckle.max_lag(); ++dc) {
        const double r = speckle.At(dr * step, dc * step) / speckle.At(0, 0);
        correlated += dr == 0 && dc == 0 ? 1 : both * share * share * r * r;
      }
    }
    // Variance of a variance: 2 plus the excess kurtosis, 6/M for a Gamma law.
    const double spread = 2 + 6 * speckle.At(0, 0) * share * share;
    const double count = columns * rows;
    const double of_one = correlated / count * entry.sharing;
    contrast_errors.push_back(values[at] * std::sqrt(spread * of_one));
    middles.push_back(share);
    covariance(at, at) =
        std::pow(contrast_errors.back(), 2) + std::pow(kContrastError * values[at], 2);
    ++at;
    const double error = std::hypot(std::sqrt(1.5 * of_one), kCorrelationError);
    for (int i = 0; i < 2 * kCorrelationLags; ++i, ++at) covariance(at, at) = error * error;
  }
  // Planes share their speckle where it is larger than a pixel.
  const int first = static_cast<int>(entry.backgrounds.size());
  for (size_t a = 0; a < entry.cores.size(); ++a) {
    for (size_t b = 0; b < entry.cores.size(); ++b) {
      if (a == b) continue;
      const double r = front.SpeckleAt(entry.cores[a].front().rows.front()).At(0, 1) /
                       front.SpeckleAt(entry.cores[a].front().rows.front()).At(0, 0);
      covariance(first + kCoreValues * static_cast<int>(a),
                 first + kCoreValues * static_cast<int>(b)) =
          std::min(0.9, r * r * middles[a] * middles[b]) * contrast_errors[a] * contrast_errors[b];
    }
  }
  return covariance;
}

RepeatStatistic::RepeatStatistic(const RecordedSet& set)
    : planes_(PixelPlanes(set.frames.front().nominal.sensor)) {
  for (size_t a = 0; a < set.frames.size(); ++a) {
    const RecordedFrame& first = set.frames[a];
    for (size_t b = a + 1; b < set.frames.size(); ++b) {
      const RecordedFrame& second = set.frames[b];
      const bool same = first.plate_position_id >= 0 &&
                        first.plate_position_id == second.plate_position_id &&
                        first.repeat_group == second.repeat_group;
      if (!same) continue;
      Entry entry;
      entry.frames = {static_cast<int>(a), static_cast<int>(b)};
      entry.bins = MakeProfileBins(first, planes_);
      entry.columns_px = first.nominal.roi.columns_px;
      if (!first.raw_dn.values.empty()) {
        for (const ProfileBin& bin : entry.bins) {
          const PixelPlane& plane = planes_[bin.plane];
          entry.recorded_mean_dn.push_back(
              0.5 * (MeanOf(first.raw_dn, plane, bin) + MeanOf(second.raw_dn, plane, bin)));
        }
      }
      entries_.push_back(std::move(entry));
      break;  // the next one only, so that pairs share little
    }
  }
}

Eigen::VectorXd RepeatStatistic::Observed(const RecordedSet& set, int index) const {
  const Entry& entry = entries_[index];
  const Image<uint16_t>& a = set.frames[entry.frames[0]].raw_dn;
  const Image<uint16_t>& b = set.frames[entry.frames[1]].raw_dn;
  const Sensor& sensor = set.frames[entry.frames[0]].nominal.sensor;
  CommonFactor factor(DarkMeanDn(sensor), kLinear * sensor.largest_dn());
  for (size_t p = 0; p < a.values.size(); ++p) factor.Add(a.values[p], b.values[p]);
  Eigen::VectorXd values(entry.bins.size());
  for (size_t i = 0; i < entry.bins.size(); ++i) {
    const PixelPlane& plane = planes_[entry.bins[i].plane];
    double sum = 0;
    int count = 0;
    for (int row : entry.bins[i].rows) {
      for (int c = plane.first_column; c < a.columns_px; c += plane.step) {
        const double difference = factor.Difference(a.At(row, c), b.At(row, c));
        sum += difference * difference / 2;
        ++count;
      }
    }
    values[i] = sum / count;
  }
  return values;
}

Eigen::VectorXd RepeatStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const auto [first, second] = std::pair(entry.frames[0], entry.frames[1]);
  const Sensor& sensor = expected.strips.front()[first].frame.sensor;
  CommonFactor factor(DarkMeanDn(sensor), kLinear * sensor.largest_dn());
  for (const std::vector<ExpectedFrame>& strips : expected.strips) {
    for (size_t q = 0; q < strips[first].level_dn.size(); ++q) {
      const std::vector<float>& a = strips[first].level_dn[q].values;
      const std::vector<float>& b = strips[second].level_dn[q].values;
      for (size_t p = 0; p < a.size(); ++p) factor.Add(a[p], b[p]);
    }
  }
  const double moved = SpeckleDecorrelation(expected.strips.front()[first],
                                            expected.strips.front()[second], expected.effects);
  Eigen::VectorXd values(entry.bins.size());
  for (size_t i = 0; i < entry.bins.size(); ++i) {
    const PixelPlane& plane = planes_[entry.bins[i].plane];
    double sum = 0, mean_dn = 0;
    for (int row : entry.bins[i].rows) {
      for (const std::vector<ExpectedFrame>& strips : expected.strips) {
        const int c = plane.first_column;
        mean_dn += (strips[first].MeanDn(row, c) + strips[second].MeanDn(row, c)) / 2;
        sum += (strips[first].noise_variance_dn2.At(row, c) +
                strips[second].noise_variance_dn2.At(row, c) +
                std::pow(strips[first].row_scatter_dn, 2) +
                std::pow(strips[second].row_scatter_dn, 2)) /
               2;
        const size_t levels = strips[first].level_dn.size();
        for (size_t q = 0; q < levels; ++q) {
          const double difference = factor.Difference(strips[first].level_dn[q].At(row, c),
                                                      strips[second].level_dn[q].At(row, c));
          sum += difference * difference / (2 * static_cast<double>(levels));
        }
        if (moved > 0) sum += moved * strips[first].level_variance_dn2.At(row, c);
      }
    }
    const auto count = static_cast<double>(entry.bins[i].rows.size() * expected.strips.size());
    values[i] = sum / count;
    if (entry.recorded_mean_dn.empty()) continue;
    // Shot noise goes with the mean: on the line by its speckle, far from it by what is not known
    // of the lens.
    const double change =
        sensor.gain_dn_per_electron * (entry.recorded_mean_dn[i] - mean_dn / count);
    values[i] += std::clamp(change, -kMostChange * values[i], kMostChange * values[i]);
  }
  return values;
}

Eigen::MatrixXd RepeatStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const Eigen::VectorXd values = Expected(expected, index);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(values.size(), values.size());
  const double moved =
      SpeckleDecorrelation(expected.strips.front()[entry.frames[0]],
                           expected.strips.front()[entry.frames[1]], expected.effects);
  for (size_t i = 0; i < entry.bins.size(); ++i) {
    const PixelPlane& plane = planes_[entry.bins[i].plane];
    const double count =
        static_cast<double>(entry.bins[i].rows.size()) * entry.columns_px / plane.step;
    // Shot noise follows the speckle: its variance scatters too, which adds to the kurtosis. Of
    // what rows draw there are as many as rows.
    // Half the squared difference of two numbers has half of their excess kurtosis.
    const double kurtosis = MeanExcessKurtosis(expected, entry.frames[0], plane, entry.bins[i]);
    covariance(i, i) = values[i] * values[i] * (4 + kurtosis / 2) / count +
                       2 * std::pow(expected.strips.front()[entry.frames[0]].row_scatter_dn, 4) /
                           static_cast<double>(entry.bins[i].rows.size());
    if (moved > 0) {
      double level = 0;
      for (const std::vector<ExpectedFrame>& strips : expected.strips) {
        for (int row : entry.bins[i].rows) {
          level += strips[entry.frames[0]].level_variance_dn2.At(row, plane.first_column);
        }
      }
      level /= static_cast<double>(entry.bins[i].rows.size() * expected.strips.size());
      covariance(i, i) += std::pow(kMovedSpeckleError * moved * level, 2);
    }
    // Where speckle reaches the top the noise is cut off: nothing is claimed there.
    double highest = 0, top = 0;
    for (const std::vector<ExpectedFrame>& strips : expected.strips) {
      const ExpectedFrame& strip = strips[entry.frames[0]];
      top = strip.frame.sensor.largest_dn();
      for (int row : entry.bins[i].rows) {
        highest = std::max<double>(highest, strip.level_dn.back().At(row, plane.first_column));
      }
    }
    if (highest > kLinear * top) covariance(i, i) = top * top;
  }
  return covariance;
}

DarkStatistic::DarkStatistic(const RecordedSet& set) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    if (set.frames[f].plate_position_id >= 0) continue;
    // What light has left is looked at in bursts: here it would be noise.
    const int before = PrecedingFrame(set, static_cast<int>(f));
    if (before >= 0 && set.frames[before].plate_position_id >= 0) continue;
    frames_.push_back({static_cast<int>(f)});
    const RegionOfInterest& roi = set.frames[f].nominal.roi;
    sizes_px_.emplace_back(roi.columns_px, roi.rows_px);
  }
}

Eigen::VectorXd DarkStatistic::Observed(const RecordedSet& set, int entry) const {
  const Image<uint16_t>& raw = set.frames[frames_[entry].front()].raw_dn;
  std::vector<double> row_means(raw.rows_px, 0), column_means(raw.columns_px, 0);
  double mean = 0;
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int column = 0; column < raw.columns_px; ++column) {
      row_means[row] += static_cast<double>(raw.At(row, column)) / raw.columns_px;
      column_means[column] += static_cast<double>(raw.At(row, column)) / raw.rows_px;
    }
    mean += row_means[row] / raw.rows_px;
  }
  const auto variance = [&](const std::vector<double>& values) {
    double sum = 0;
    for (double value : values) sum += (value - mean) * (value - mean);
    return sum / static_cast<double>(values.size() - 1);
  };
  double pixels = 0;
  for (uint16_t value : raw.values) pixels += (value - mean) * (value - mean);
  pixels /= static_cast<double>(raw.values.size() - 1);
  // The quartiles' deviation is not moved by the outliers it is to find.
  std::vector<uint16_t> sorted = raw.values;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2];
  const double spread =
      std::max(0.5, (sorted[sorted.size() * 3 / 4] - sorted[sorted.size() / 4]) / 1.349);
  double outliers = 0;
  for (uint16_t value : raw.values) outliers += std::abs(value - median) > 8 * spread ? 1 : 0;
  Eigen::VectorXd values(4);
  values << pixels, variance(row_means), variance(column_means),
      outliers / static_cast<double>(raw.values.size());
  return values;
}

Eigen::VectorXd DarkStatistic::Expected(const ExpectedSet& expected, int entry) const {
  const int f = frames_[entry].front();
  const auto [columns, rows] = sizes_px_[entry];
  double independent = 0, fixed_mean = 0, fixed_square = 0, count = 0;
  for (const std::vector<ExpectedFrame>& strips : expected.strips) {
    const ExpectedFrame& strip = strips[f];
    for (int row = 0; row < strip.noise_variance_dn2.rows_px; ++row) {
      for (int column = 0; column < strip.noise_variance_dn2.columns_px; ++column) {
        independent += NoiseVariance(strip, row, column);
        const double mean = strip.MeanDn(row, column);
        fixed_mean += mean;
        fixed_square += mean * mean;
        ++count;
      }
    }
  }
  independent /= count;
  fixed_mean /= count;
  const double pixels = independent + std::max(0.0, fixed_square / count - fixed_mean * fixed_mean);
  Eigen::VectorXd values(4);
  const ExpectedFrame& any = expected.strips.front()[f];
  const double of_rows = any.row_scatter_dn * any.row_scatter_dn;
  const double of_columns = any.column_scatter_dn * any.column_scatter_dn;
  // What rows draw is alike in the means of all columns.
  values << pixels + of_rows + of_columns, pixels / columns + of_rows, pixels / rows + of_columns,
      0;
  return values;
}

Eigen::MatrixXd DarkStatistic::Covariance(const ExpectedSet& expected, int entry) const {
  const auto [columns, rows] = sizes_px_[entry];
  const Eigen::VectorXd values = Expected(expected, entry);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(4, 4);
  const double pixels = static_cast<double>(columns) * rows;
  covariance(1, 1) = values[1] * values[1] * 2 / rows;
  covariance(2, 2) = values[2] * values[2] * 2 / columns;
  // The variance of the pixels is that within rows and columns and those of their means.
  const double kurtosis = expected.strips.front()[frames_[entry].front()].NoiseExcessKurtosis(0, 0);
  covariance(0, 0) =
      values[0] * values[0] * (2 + kurtosis) / pixels + covariance(1, 1) + covariance(2, 2);
  covariance(0, 1) = covariance(1, 0) = covariance(1, 1);
  covariance(0, 2) = covariance(2, 0) = covariance(2, 2);
  // Half a pixel.
  covariance(3, 3) = 0.25 / (pixels * pixels);
  return covariance;
}

}  // namespace sightline
