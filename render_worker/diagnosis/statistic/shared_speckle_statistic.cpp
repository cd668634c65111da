// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/shared_speckle_statistic.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "render_worker/diagnosis/expectation/normal_distribution.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Bins of the longer exposure, shares of what lies between dark and the largest number.
constexpr double kEdges[] = {0.02, 0.04, 0.07, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};
constexpr double kFewPixelsOfBin = 50;
// The Gaussian noise of the model is not quite the Poisson noise of the sensor.
constexpr double kVarianceError = 0.01;
// Of what moving speckle adds to the variance, and of what it does to the mean of a bin.
constexpr double kMotionError = 0.2;

// Where the speckle is at equally weighted moments of an exposure [px].
struct Place {
  double u_px = 0, v_px = 0;
};

// Moving scatterers: the same for every draw.
std::vector<Place> ScattererPlaces(const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  SpeckleModel speckle;
  for (const ActiveEffect& active : effects) {
    active.effect->OnSpeckle(speckle, frame, active.parameters);
  }
  std::vector<Place> places;
  for (const SpeckleModel::Shift& shift : speckle.shifts) {
    places.push_back(
        {shift.u_m / frame.sensor.pixel_pitch_m, shift.v_m / frame.sensor.pixel_pitch_m});
  }
  return places;
}

// Mean shift of the image across the line during the exposure, from the phase of the transfer
// functions at a low frequency [px]; `draw` seeds what is drawn for each recording.
double ImageShift(FrameSetup frame, std::span<const ActiveEffect> effects, uint64_t draw) {
  constexpr double kTurnsPerPx = 1e-3;
  frame.seeds.noise += draw;
  const OpticsModel optics = MakeOpticsModel(frame, effects);
  double phase = 0;
  for (const TransferFunction& factor : optics.transfer) {
    phase += std::arg(std::complex<double>(factor(0, kTurnsPerPx / frame.sensor.pixel_pitch_m)));
  }
  return -phase / (2 * std::numbers::pi * kTurnsPerPx);
}

// Temporal noise at a number [DN^2]: shot noise of what it has above the dark mean; none where the
// pixel is full.
double NoiseVariance(const Sensor& sensor, double level_dn) {
  const double gain = sensor.gain_dn_per_electron;
  const double dark_dn = DarkMeanDn(sensor);
  const double full_dn = gain * sensor.saturation_capacity_electrons + sensor.black_level_dn;
  if (level_dn > full_dn - 0.5) return 1.0 / 12;
  return std::pow(gain * sensor.dark_noise_electrons, 2) + 1.0 / 12 +
         gain * std::max(0.0, level_dn - dark_dn);
}

// Share of a normal distribution between each two edges.
void Shares(const std::vector<double>& edges, double mean, double deviation,
            std::vector<double>& shares) {
  const auto below = [&](double edge) {
    const double x = (edge - mean) / deviation;
    return x > 5 ? 1.0 : x < -5 ? 0.0 : NormalDistribution(x);
  };
  double last = below(edges.front());
  for (size_t i = 0; i + 1 < edges.size(); ++i) {
    const double next = below(edges[i + 1]);
    shares[i] = next - last;
    last = next;
  }
}

}  // namespace

double SpeckleDecorrelation(const ExpectedFrame& a, const ExpectedFrame& b,
                            std::span<const ActiveEffect> effects) {
  if (effects.empty() || a.speckle == nullptr) return 0;
  const SpecklePixelCovariance& speckle = a.speckle->At(a.speckle->places() / 2);
  // A parabola at the top, as the covariance has one: a Gaussian through the neighbour.
  const double along = std::log(speckle.At(0, 0) / std::max(1e-9, speckle.At(0, 1)));
  const double across = std::log(speckle.At(0, 0) / std::max(1e-9, speckle.At(1, 0)));
  const auto mean = [&](const std::vector<Place>& p, const std::vector<Place>& q, double shift) {
    double sum = 0;
    for (const Place& s : p) {
      for (const Place& t : q) {
        sum += std::exp(-along * std::pow(s.u_px - t.u_px, 2) -
                        across * std::pow(s.v_px - t.v_px + shift, 2));
      }
    }
    return sum / static_cast<double>(p.size() * q.size());
  };
  const std::vector<Place> p = ScattererPlaces(a.frame, effects);
  const std::vector<Place> q = ScattererPlaces(b.frame, effects);
  constexpr int kDraws = 8;
  double common = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const double shift = ImageShift(a.frame, effects, draw) - ImageShift(b.frame, effects, draw);
    common += mean(p, q, shift) / kDraws;
    if (draw == 0 && shift == 0) {
      common = mean(p, q, 0);
      break;
    }
  }
  return std::max(0.0, 0.5 * (mean(p, p, 0) + mean(q, q, 0)) - common);
}

double SharedSpeckleStatistic::Pair::NominalVariance(double sum_dn) const {
  const double signal_dn = std::max(0.0, (sum_dn - 2 * offset_dn) * ratio / (1 + ratio));
  return (1 + ratio) * gain_dn * signal_dn + dark_noise;
}

SharedSpeckleStatistic::SharedSpeckleStatistic(const RecordedSet& set) {
  std::map<int, std::vector<int>> of_position;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const int id = set.frames[f].plate_position_id;
    if (id >= 0) of_position[id].push_back(static_cast<int>(f));
  }
  for (const auto& [id, all] : of_position) {
    const FrameSetup& front = set.frames[all.front()].nominal;
    Entry entry;
    for (int f : all) {
      if (SameSpeckle(set.frames[all.front()], set.frames[f])) entry.frames.push_back(f);
    }
    if (entry.frames.size() < 2) continue;
    std::vector<int> order = entry.frames;
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return set.frames[a].nominal.exposure_time_s < set.frames[b].nominal.exposure_time_s;
    });
    const Sensor& sensor = front.sensor;
    const double gain = sensor.gain_dn_per_electron;
    const double offset = DarkMeanDn(sensor);
    const double span = sensor.largest_dn() - offset;
    const double dark = std::pow(gain * sensor.dark_noise_electrons, 2) + 1.0 / 12;
    for (size_t i = 0; i + 1 < order.size(); ++i) {
      Pair pair;
      pair.first = order[i];
      pair.second = order[i + 1];
      pair.ratio = set.frames[pair.second].nominal.exposure_time_s /
                   set.frames[pair.first].nominal.exposure_time_s;
      pair.offset_dn = offset;
      pair.gain_dn = gain;
      pair.dark_noise = (1 + pair.ratio * pair.ratio) * dark;
      for (double edge : kEdges) {
        pair.edges_dn.push_back(2 * offset + edge * span * (1 + pair.ratio) / pair.ratio);
      }
      const double margin = 6 * std::sqrt(gain * span / pair.ratio + dark);
      pair.saturated_dn = offset + 1.1 * span / pair.ratio + margin;
      entry.size += pair.size();
      entry.pairs.push_back(std::move(pair));
    }
    entry.columns_px = front.roi.columns_px;
    entries_.push_back(std::move(entry));
    Entry& added = entries_.back();
    if (!set.frames[order.front()].raw_dn.empty()) {
      for (const Pair& pair : added.pairs) {
        std::vector<double> count(pair.size(), 0);
        const std::vector<uint16_t>& a = set.frames[pair.first].raw_dn.values;
        const std::vector<uint16_t>& b = set.frames[pair.second].raw_dn.values;
        for (size_t p = 0; p < a.size(); ++p) {
          const double sum = static_cast<double>(a[p]) + b[p];
          const auto edge = std::upper_bound(pair.edges_dn.begin(), pair.edges_dn.end(), sum);
          if (edge != pair.edges_dn.begin() && edge != pair.edges_dn.end()) {
            ++count[edge - pair.edges_dn.begin() - 1];
            ++count[pair.bins() + 1];
          }
          if (a[p] >= pair.saturated_dn) ++count[pair.bins()];
        }
        added.observed_count.insert(added.observed_count.end(), count.begin(), count.end());
      }
    }
  }
}

int SharedSpeckleStatistic::FrameOfRow(int entry, int row) const {
  const std::vector<Pair>& pairs = entries_[entry].pairs;
  return pairs[row / pairs.front().size()].second;
}

Eigen::VectorXd SharedSpeckleStatistic::Observed(const RecordedSet& set, int index) const {
  const Entry& entry = entries_[index];
  Eigen::VectorXd values = Eigen::VectorXd::Zero(entry.size);
  int at = 0;
  for (const Pair& pair : entry.pairs) {
    const std::vector<uint16_t>& a = set.frames[pair.first].raw_dn.values;
    const std::vector<uint16_t>& b = set.frames[pair.second].raw_dn.values;
    const int bins = pair.bins();
    std::vector<double> count(bins, 0), sum(bins, 0), square(bins, 0), variance(bins, 0);
    double saturated = 0, saturated_sum = 0;
    for (size_t p = 0; p < a.size(); ++p) {
      if (a[p] >= pair.saturated_dn) {
        ++saturated;
        saturated_sum += b[p];
      }
      const double z = static_cast<double>(a[p]) + b[p];
      const auto edge = std::upper_bound(pair.edges_dn.begin(), pair.edges_dn.end(), z);
      if (edge == pair.edges_dn.begin() || edge == pair.edges_dn.end()) continue;
      const auto bin = edge - pair.edges_dn.begin() - 1;
      const double difference = b[p] - pair.ratio * a[p];
      // Standardised pixel by pixel: bins are wide.
      const double weight = 1 / pair.NominalVariance(z);
      ++count[bin];
      sum[bin] += difference;
      square[bin] += difference * difference * weight;
      variance[bin] += weight;
    }
    double spread = 0, pixels = 0;
    for (int bin = 0; bin < bins; ++bin) {
      if (count[bin] == 0) continue;
      const double mean = sum[bin] / count[bin];
      values[at + bin] = mean;
      if (count[bin] < kFewPixelsOfBin) continue;
      // About the bin's mean: sum of w (d - m)^2, the cross term by the mean weight.
      spread += square[bin] - mean * mean * variance[bin];
      pixels += count[bin] - 1;
    }
    values[at + bins] = saturated > 0 ? saturated_sum / saturated : 0;
    values[at + bins + 1] = pixels > 0 ? spread / pixels : 1;
    at += pair.size();
  }
  return values;
}

// Levels are few and far apart where light is strong, so that single ones would show in the bins:
// there each stands for as many parts, on straight lines between them.
constexpr size_t kPartsOfLevel = 3;
constexpr double kStraight = 0.7;  // of the largest number, up to which lines are straight

double LevelDn(const ExpectedFrame& frame, int row, int column, size_t level) {
  return frame.level_dn[level].At(row, column);
}

// 1 where noise blurs the step to the next level in all of these recordings.
size_t PartsOfLevel(const std::vector<ExpectedFrame>& strips, const std::vector<int>& frames,
                    int row, int column, size_t level) {
  for (int f : frames) {
    const size_t levels = strips[f].level_dn.size();
    if (levels < 2) continue;
    const size_t below = std::min(level, levels - 2);
    const double here = LevelDn(strips[f], row, column, below);
    const double step = LevelDn(strips[f], row, column, below + 1) - here;
    if (step * step > NoiseVariance(strips[f].frame.sensor, here)) return kPartsOfLevel;
  }
  return 1;
}

// Numbers of a pixel in two recordings at a part of a level.
std::pair<double, double> LevelsAt(const ExpectedFrame& a, const ExpectedFrame& b, int row,
                                   int column, size_t level, size_t part, size_t parts) {
  std::pair numbers(LevelDn(a, row, column, level), LevelDn(b, row, column, level));
  const size_t last = a.level_dn.size() - 1;
  const double offset = (static_cast<double>(part) + 0.5) / static_cast<double>(parts) - 0.5;
  if (last == 0 || offset == 0) return numbers;
  const size_t below = offset < 0 && level > 0 ? level - 1 : std::min(level, last - 1);
  const double above_b = LevelDn(b, row, column, below + 1);
  if (above_b > kStraight * b.frame.sensor.largest_dn()) return numbers;
  numbers.first += offset * (LevelDn(a, row, column, below + 1) - LevelDn(a, row, column, below));
  numbers.second += offset * (above_b - LevelDn(b, row, column, below));
  return numbers;
}

// Of y_b - r y_a (and, for 1, of the sum), by what rows draw.
double RowVariance(const ExpectedFrame& a, const ExpectedFrame& b, double ratio) {
  return std::pow(b.row_scatter_dn, 2) + std::pow(ratio * a.row_scatter_dn, 2);
}

// Sums over the pixels that the levels of speckle stand for.
struct SharedSpeckleStatistic::Moments {
  Eigen::VectorXd count, sum,
      noise;  // of every value: pixels, mean times them, variance times them
  // Of every bin: the variance, and that of what is expected of its pixels, over the nominal one.
  Eigen::VectorXd square, weight;
  std::vector<Eigen::MatrixXd> common;  // of a pair's bins and the next one's: shared noise
  std::vector<double> decorrelation;    // of every pair
  Eigen::MatrixXd of_rows;              // of every value: pixels by row; empty: rows draw nothing
};

SharedSpeckleStatistic::Moments SharedSpeckleStatistic::Evaluate(const ExpectedSet& expected,
                                                                 const Entry& entry,
                                                                 bool with_common) const {
  Moments moments;
  moments.count = moments.sum = moments.noise = Eigen::VectorXd::Zero(entry.size);
  moments.square = moments.weight = Eigen::VectorXd::Zero(entry.size);
  const size_t pairs = entry.pairs.size();
  std::vector<double>& decorrelation = moments.decorrelation;
  decorrelation.resize(pairs);
  std::vector<double> shares(std::size(kEdges) - 1), before(shares.size());
  for (size_t i = 0; i < pairs; ++i) {
    decorrelation[i] =
        SpeckleDecorrelation(expected.strips.front()[entry.pairs[i].first],
                             expected.strips.front()[entry.pairs[i].second], expected.effects);
    if (i > 0) moments.common.emplace_back(Eigen::MatrixXd::Zero(shares.size(), shares.size()));
  }
  // The columns of a cell of the colour filter stand for all of their block.
  const Sensor& of_all = expected.strips.front()[entry.frames.front()].frame.sensor;
  const int cell_columns = of_all.colour_filter == ColourFilter::kMono ? 1 : 2;
  for (const std::vector<ExpectedFrame>& strips : expected.strips) {
    const ExpectedFrame& any = strips[entry.frames.front()];
    const size_t levels = any.level_dn.size();
    const double pixels_of_level =
        static_cast<double>(entry.columns_px) /
        static_cast<double>(expected.strips.size() * cell_columns * levels);
    const int rows_px = any.noise_variance_dn2.rows_px;
    const bool rows_scatter = any.row_scatter_dn > 0;
    if (rows_scatter && moments.of_rows.size() == 0) {
      moments.of_rows = Eigen::MatrixXd::Zero(entry.size, rows_px);
    }
    for (int row = 0; row < rows_px; ++row) {
      for (int column = 0; column < cell_columns; ++column) {
        // Variance of the levels over their mean above the dark.
        std::vector<double> mean(pairs + 1), spread(pairs + 1, 0), dark(pairs + 1, 0);
        for (size_t i = 0; i <= pairs; ++i) {
          const int f = i < pairs ? entry.pairs[i].first : entry.pairs[i - 1].second;
          mean[i] = strips[f].MeanDn(row, column);
          if (i == 0 || decorrelation[i - 1] == 0) continue;
          spread[i] = strips[f].level_variance_dn2.At(row, column);
          dark[i] = DarkMeanDn(strips[f].frame.sensor);
          spread[i] /= std::max(1e-9, mean[i] - dark[i]);
        }
        for (size_t level = 0; level < levels; ++level) {
          const size_t parts = PartsOfLevel(strips, entry.frames, row, column, level);
          const double pixels = pixels_of_level / static_cast<double>(parts);
          for (size_t part = 0; part < parts; ++part) {
            int at = 0;
            bool used_before = false;
            for (size_t i = 0; i < pairs; ++i) {
              const Pair& pair = entry.pairs[i];
              const int bins = pair.bins();
              const ExpectedFrame& a = strips[pair.first];
              const ExpectedFrame& b = strips[pair.second];
              const Sensor& sensor = b.frame.sensor;
              const double gain = sensor.gain_dn_per_electron;
              const auto [level_a, level_b] = LevelsAt(a, b, row, column, level, part, parts);
              const double noise_a = NoiseVariance(sensor, level_a);
              const double noise_b = NoiseVariance(sensor, level_b);
              // Lines between levels cut the corner where saturation begins: whole levels there.
              const bool whole = part == parts / 2;
              if (whole && level_a + 5 * std::sqrt(noise_a) > pair.saturated_dn) {
                const double share =
                    1 - NormalDistribution((pair.saturated_dn - level_a) / std::sqrt(noise_a));
                moments.count[at + bins] += pixels_of_level * share;
                moments.sum[at + bins] += pixels_of_level * share * level_b;
              }
              const double z = level_a + level_b;
              const double deviation = std::sqrt(noise_a + noise_b + RowVariance(a, b, 1));
              const bool used = z + 5 * deviation > pair.edges_dn.front() &&
                                z - 5 * deviation < pair.edges_dn.back();
              if (used) {
                Shares(pair.edges_dn, z, deviation, shares);
                const double difference = level_b - pair.ratio * level_a;
                // The fixed offsets of the pixels do not scale with the exposure.
                const double dsnu = sensor.dsnu_electrons * gain * (1 - pair.ratio);
                // Moving speckle changes in proportion to the root of the irradiance: the
                // derivatives of a circular Gaussian field are independent of the field (Goodman,
                // Speckle Phenomena in Optics, on the derivatives of speckle intensity).
                const double noise =
                    noise_b + pair.ratio * pair.ratio * noise_a + dsnu * dsnu +
                    2 * decorrelation[i] * spread[i + 1] * std::max(0.0, level_b - dark[i + 1]);
                const double nominal = pair.NominalVariance(z);
                const double of_row = RowVariance(a, b, pair.ratio);
                for (int bin = 0; bin < bins; ++bin) {
                  if (shares[bin] == 0) continue;
                  const double weight = pixels * shares[bin];
                  moments.count[at + bin] += weight;
                  moments.sum[at + bin] += weight * difference;
                  moments.noise[at + bin] += weight * noise;
                  moments.square[at + bin] +=
                      weight * (noise + of_row + difference * difference) / nominal;
                  if (rows_scatter) {
                    moments.of_rows(at + bin, row) += weight;
                    moments.of_rows(at + bins + 1, row) += weight * of_row / nominal;
                  }
                  moments.weight[at + bin] += weight / nominal;
                  if (!used_before || !with_common) continue;
                  for (int other = 0; other < bins; ++other) {
                    moments.common[i - 1](other, bin) -=
                        before[other] * weight * pair.ratio * noise_a;
                  }
                }
              }
              used_before = used;
              before.swap(shares);
              at += pair.size();
            }
          }
        }
      }
    }
  }
  // Where the line has moved or light has spread, pixels of one bin differ by what is expected of
  // them too.
  int at = 0;
  for (const Pair& pair : entry.pairs) {
    const int bins = pair.bins();
    for (int bin = at; bin < at + bins; ++bin) {
      if (moments.count[bin] <= 0) continue;
      const double mean = moments.sum[bin] / moments.count[bin];
      moments.count[at + bins + 1] += moments.count[bin];
      moments.sum[at + bins + 1] += moments.square[bin] - mean * mean * moments.weight[bin];
    }
    at += pair.size();
  }
  return moments;
}

Eigen::VectorXd SharedSpeckleStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const Moments moments = Evaluate(expected, entry, false);
  Eigen::VectorXd values(entry.size);
  int at = 0;
  for (const Pair& pair : entry.pairs) {
    for (int i = 0; i < pair.size(); ++i, ++at) {
      // Without pixels: the value of a linear sensor without noise.
      double fallback = pair.offset_dn * (1 - pair.ratio);
      if (i >= pair.bins()) fallback = i == pair.bins() ? 0 : 1;
      values[at] = moments.count[at] > 1e-6 ? moments.sum[at] / moments.count[at] : fallback;
    }
  }
  return values;
}

Eigen::MatrixXd SharedSpeckleStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const Moments moments = Evaluate(expected, entry, true);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(entry.size, entry.size);
  int at = 0;
  for (size_t i = 0; i < entry.pairs.size(); ++i) {
    const Pair& pair = entry.pairs[i];
    const double top = expected.strips.front()[pair.second].frame.sensor.largest_dn();
    for (int k = 0; k < pair.size(); ++k) {
      const double count = moments.count[at + k];
      const double seen = entry.observed_count.empty() ? count : entry.observed_count[at + k];
      double& variance = covariance(at + k, at + k);
      if (std::min(seen, count) < kFewPixelsOfBin) {
        variance = k == pair.bins() + 1 ? 1e4 : top * top;  // nothing to say
      } else if (k == pair.bins()) {
        variance = 0.25;  // the top is exact; half a number for what the levels leave out
      } else if (k == pair.bins() + 1) {
        const double excess = moments.sum[at + k] / count - 1;
        variance = 2 / seen + kVarianceError * kVarianceError +
                   std::pow(kMotionError * std::max(0.0, excess), 2);
      } else {
        // Where speckle has moved, numbers regress to the mean: by at most this.
        const double signal = 0.5 * (pair.edges_dn[k] + pair.edges_dn[k + 1]) - 2 * pair.offset_dn;
        const double regression = moments.decorrelation[i] * pair.ratio * std::abs(pair.ratio - 1) /
                                  std::pow(1 + pair.ratio, 2);
        variance = moments.noise[at + k] / (count * seen) + std::pow(regression * signal, 2);
      }
    }
    if (i + 1 < entry.pairs.size()) {
      const int next = at + pair.size();
      for (int a = 0; a < pair.bins(); ++a) {
        for (int b = 0; b < entry.pairs[i + 1].bins(); ++b) {
          const double counts = moments.count[at + a] * moments.count[next + b];
          if (counts < kFewPixelsOfBin * kFewPixelsOfBin) continue;
          double seen = counts;
          if (!entry.observed_count.empty()) {
            seen = entry.observed_count[at + a] * entry.observed_count[next + b];
          }
          if (seen < kFewPixelsOfBin * kFewPixelsOfBin) continue;
          covariance(at + a, next + b) = moments.common[i](a, b) / std::max(counts, seen);
          covariance(next + b, at + a) = covariance(at + a, next + b);
        }
      }
    }
    at += pair.size();
  }
  if (moments.of_rows.size() > 0) AddRowScatter(expected, entry, moments, covariance);
  return covariance;
}

// All pixels of a row have what it draws; a recording's rows are in the pair before and in its own.
void SharedSpeckleStatistic::AddRowScatter(const ExpectedSet& expected, const Entry& entry,
                                           const Moments& moments, Eigen::MatrixXd& covariance) {
  const std::vector<ExpectedFrame>& strips = expected.strips.front();
  const auto shared_rows = [&](int k, int l) {
    const double counts = moments.count[k] * moments.count[l];
    return counts > 0 ? moments.of_rows.row(k).dot(moments.of_rows.row(l)) / counts : 0;
  };
  int at = 0;
  for (size_t i = 0; i < entry.pairs.size(); ++i) {
    const Pair& pair = entry.pairs[i];
    const double variance = RowVariance(strips[pair.first], strips[pair.second], pair.ratio);
    for (int k = 0; k < pair.bins(); ++k) {
      for (int l = 0; l < pair.bins(); ++l) {
        covariance(at + k, at + l) += variance * shared_rows(at + k, at + l);
      }
    }
    // Of variances there are as many as rows.
    const int of_variance = at + pair.bins() + 1;
    covariance(of_variance, of_variance) += 2 * shared_rows(of_variance, of_variance);
    const int next = at + pair.size();
    if (i + 1 < entry.pairs.size()) {
      const Pair& other = entry.pairs[i + 1];
      const double both = -other.ratio * std::pow(strips[pair.second].row_scatter_dn, 2);
      for (int k = 0; k < pair.bins(); ++k) {
        for (int l = 0; l < other.bins(); ++l) {
          covariance(at + k, next + l) += both * shared_rows(at + k, next + l);
          covariance(next + l, at + k) = covariance(at + k, next + l);
        }
      }
    }
    at = next;
  }
}

}  // namespace sightline
