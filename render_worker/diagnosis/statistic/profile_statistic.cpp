// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/profile_statistic.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "render_worker/recordings/strips.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

namespace {

// Against simulated null sets.
constexpr double kUnsharedVariance = 0.12;
// Between recordings of one speckle: pixel by pixel they are compared by another statistic
// (shared_speckle_statistic.h).
constexpr double kUnsharedBetweenRecordings = 0.3;
constexpr double kProfileModelError = 0.005;
// Of the far wings of the line's image, below this part of its crest: renderers cut them off.
constexpr double kWingError = 0.2;
constexpr double kWing = 0.003;
// And of what is left of it at the region's edge, besides what all recordings have in common: for
// lines in focus and out of focus.
constexpr double kTailInFocusError = 0.3, kTailOutOfFocusError = 1;
constexpr double kInFocusPx = 2;  // radius of the blur up to which a line is in focus
// Of the largest number, where half of the speckle is cut off: its law there is not quite a Gamma
// law.
constexpr double kSaturationError = 0.01;

// A covariance with these variances: correlations that are put together from places with different
// statistics need not be one, and are then lowered alike.
void MakePositive(Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd deviation = covariance.diagonal().cwiseMax(1e-30).cwiseSqrt();
  const Eigen::VectorXd inverse = deviation.cwiseInverse();
  const Eigen::MatrixXd correlation = inverse.asDiagonal() * covariance * inverse.asDiagonal();
  for (double part = 1; part > 0.05; part *= 0.9) {
    Eigen::MatrixXd lowered = part * correlation;
    // Something is added to the variances anyway.
    lowered.diagonal().setConstant(1.01);
    if (lowered.llt().info() != Eigen::Success) continue;
    if (part == 1) return;
    lowered.diagonal().setOnes();
    covariance = deviation.asDiagonal() * lowered * deviation.asDiagonal();
    return;
  }
  covariance = Eigen::MatrixXd(covariance.diagonal().asDiagonal());
}

// Correlation of the means of rows over a block's columns, of one plane of the pixels.
class MeanCorrelation {
 public:
  // Of `columns` pixels every `step` columns.
  MeanCorrelation(const LineSpeckle& line, const FrameSetup& frame, int columns, int step)
      : line_(line), frame_(frame), distances_(2 * line.max_lag() + 1) {
    correlation_.resize(static_cast<size_t>(line.places()) * distances_ * kPhases);
    for (int place = 0; place < line.places(); ++place) {
      const SpecklePixelCovariance& pixel = line.At(place);
      for (int dr = -max_lag(); dr <= max_lag(); ++dr) {
        for (int phase = -1; phase <= 1; ++phase) {
          correlation_[Index(place, dr, phase)] =
              CovarianceOfMeans(pixel, dr, columns, step, phase) / pixel.At(0, 0);
        }
      }
    }
  }

  int max_lag() const { return line_.max_lag(); }

  int PlaceOf(int row) const {
    return line_.PlaceOf((frame_.roi.row_px + row) * frame_.sensor.pixel_pitch_m);
  }

  // By the speckle at a place across the line, of rows `distance` apart; `phase`: -1, 0 or 1,
  // columns between the planes of the two.
  double At(int place, int distance, int phase) const {
    return correlation_[Index(place, distance, phase)];
  }

 private:
  static constexpr int kPhases = 3;
  size_t Index(int place, int distance, int phase) const {
    return (static_cast<size_t>(place) * distances_ + distance + max_lag()) * kPhases + phase + 1;
  }

  const LineSpeckle& line_;
  const FrameSetup& frame_;
  int distances_;
  std::vector<double> correlation_;
};

// Signal at the outermost bins, from which all is counted: a hard-edged pupil's line spread falls
// off with the square of the distance, so its fall from two thirds of the way tells what is left.
double SignalAtEdge(const std::vector<ProfileBin>& bins, const Eigen::ArrayXd& signal, int plane) {
  double edge_px = 0;
  for (const ProfileBin& bin : bins) edge_px = std::max(edge_px, std::abs(bin.centre_px));
  double crest = 0, left = 0, nearest = 0.3;
  for (size_t i = 0; i < bins.size(); ++i) {
    if (bins[i].plane != plane) continue;
    const double here = signal[static_cast<Eigen::Index>(i)];
    crest = std::max(crest, here);
    const double x = std::abs(bins[i].centre_px) / edge_px;
    if (std::abs(x - 2.0 / 3) >= nearest) continue;
    nearest = std::abs(x - 2.0 / 3);
    left = here / (1 / (x * x) - 1);
  }
  return std::clamp(left, 0.0, kWing * crest);
}

// The same for every bin of a group.
Eigen::VectorXd Tails(const Eigen::VectorXd& means, const ProfileGroup& members) {
  Eigen::VectorXd tails(means.size());
  const double background = means.minCoeff();
  Eigen::Index first = 0;
  for (const std::vector<ProfileBin>& bins : members.bins) {
    const auto size = static_cast<Eigen::Index>(bins.size());
    const Eigen::ArrayXd signal = means.segment(first, size).array() - background;
    std::map<int, double> of_plane;
    for (const ProfileBin& bin : bins) {
      if (!of_plane.contains(bin.plane)) {
        of_plane[bin.plane] = SignalAtEdge(bins, signal, bin.plane);
      }
      tails[first++] = of_plane[bin.plane];
    }
  }
  return tails;
}

// Noise and what the approximations leave: a part of the scatter that neighbours do not share, and
// of the signal.
void AddModelErrors(const Eigen::VectorXd& means, const ProfileGroup& members, int blocks,
                    const Eigen::VectorXd& noise_variance,
                    const Eigen::VectorXd& saturation_variance, Eigen::MatrixXd& covariance) {
  const double background = means.minCoeff();
  // What is doubtful in the wings and in what is left at the edge: alike in all bins of a group,
  // and in all blocks, whose entries do not know of each other.
  Eigen::VectorXd wing(members.size), tail = Tails(means, members);
  int first_entry = 0;
  for (size_t m = 0; m < members.frames.size(); ++m) {
    const auto size = static_cast<Eigen::Index>(members.bins[m].size());
    const Eigen::ArrayXd signal = means.segment(first_entry, size).array() - background;
    wing.segment(first_entry, size) = (kWingError * signal.min(kWing * signal.maxCoeff())).matrix();
    tail.segment(first_entry, size) *=
        members.in_focus[m] ? kTailInFocusError : kTailOutOfFocusError;
    first_entry += static_cast<int>(size);
  }
  wing *= std::sqrt(static_cast<double>(blocks));
  tail *= std::sqrt(static_cast<double>(blocks));
  for (int i = 0; i < members.size; ++i) {
    const double signal = means[i] - background;
    covariance(i, i) *=
        1 + (members.frames.size() > 1 ? kUnsharedBetweenRecordings : kUnsharedVariance);
    covariance(i, i) += std::pow(kProfileModelError * signal, 2) + noise_variance[i] +
                        saturation_variance[i] + 0.25 * (wing[i] * wing[i] + tail[i] * tail[i]);
  }
  covariance += wing * wing.transpose() + tail * tail.transpose();
}

}  // namespace

// What the frame before has left in a dark one has that frame's speckle.
Eigen::VectorXd ProfileStatistic::ErrorOfWhatIsLeft(const ProfileGroup& members,
                                                    const std::vector<ExpectedFrame>& strips,
                                                    int columns, int step) const {
  Eigen::VectorXd error = Eigen::VectorXd::Zero(members.size);
  const ExpectedFrame& lit = strips[members.preceding];
  const ExpectedFrame& dark = strips[members.frames.front()];
  if (lit.speckle == nullptr) return error;
  const FrameSetup& frame = dark.frame;
  Eigen::Index entry = 0;
  for (const ProfileBin& bin : members.bins.front()) {
    std::vector<double> left(frame.roi.rows_px, 0);
    for (int row : bin.rows) {
      left[row] = frame.sensor.gain_dn_per_electron *
                  dark.mean_photo_electrons.At(row, planes_[bin.plane].first_column) /
                  static_cast<double>(bin.rows.size());
    }
    error[entry++] = std::sqrt(VarianceOfRows(*lit.speckle, left, columns, step, frame.roi.row_px,
                                              frame.sensor.pixel_pitch_m));
  }
  return error;
}

ProfileStatistic::ProfileStatistic(const RecordedSet& set, int blocks_along_line)
    : blocks_(blocks_along_line), planes_(PixelPlanes(set.frames.front().nominal.sensor)) {
  std::map<int, int> group_of_position;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    int group = static_cast<int>(groups_.size());
    if (recorded.plate_position_id >= 0) {
      group = group_of_position.emplace(recorded.plate_position_id, group).first->second;
    }
    if (group == static_cast<int>(groups_.size())) groups_.emplace_back();
    ProfileGroup& members = groups_[group];
    members.frames.push_back(static_cast<int>(f));
    members.in_focus.push_back(DefocusRadiusPx(recorded.nominal) < kInFocusPx);
    members.columns_px = recorded.nominal.roi.columns_px;
    const int before = PrecedingFrame(set, static_cast<int>(f));
    if (recorded.plate_position_id < 0 && before >= 0 &&
        set.frames[before].plate_position_id >= 0) {
      members.preceding = before;
    }
    std::vector<ProfileBin> bins = MakeProfileBins(recorded, planes_);
    members.size += static_cast<int>(bins.size());
    members.bins.push_back(std::move(bins));
  }
  std::map<std::pair<int, int>, int> groups_at;  // column and row of the sensor
  const auto corner = [&](const ProfileGroup& members) {
    const RegionOfInterest& roi = set.frames[members.frames.front()].nominal.roi;
    return std::pair(roi.column_px, roi.row_px);
  };
  for (const ProfileGroup& members : groups_) ++groups_at[corner(members)];
  for (ProfileGroup& members : groups_) members.sharing = groups_at[corner(members)];
}

int ProfileStatistic::FrameOfRow(int entry, int row) const {
  const ProfileGroup& members = groups_[entry / blocks_];
  size_t m = 0;
  while (row >= static_cast<int>(members.bins[m].size())) {
    row -= static_cast<int>(members.bins[m++].size());
  }
  return members.frames[m];
}

double ProfileStatistic::OffsetOfRow(int entry, int row) const {
  const ProfileGroup& members = groups_[entry / blocks_];
  size_t m = 0;
  while (row >= static_cast<int>(members.bins[m].size())) {
    row -= static_cast<int>(members.bins[m++].size());
  }
  return members.bins[m][row].centre_px;
}

Eigen::VectorXd ProfileStatistic::Observed(const RecordedSet& set, int entry_index) const {
  const ProfileGroup& members = groups_[entry_index / blocks_];
  Eigen::VectorXd means(members.size);
  int entry = 0;
  for (size_t m = 0; m < members.frames.size(); ++m) {
    const Image<uint16_t>& raw = set.frames[members.frames[m]].raw_dn;
    const auto [first, last] = BlockColumns(raw.columns_px, blocks_, entry_index % blocks_);
    for (const ProfileBin& bin : members.bins[m]) {
      const PixelPlane& plane = planes_[bin.plane];
      double sum = 0;
      int count = 0;
      for (int row : bin.rows) {
        for (int column = first + plane.first_column; column < last; column += plane.step) {
          sum += raw.At(row, column);
          ++count;
        }
      }
      means[entry++] = sum / count;
    }
  }
  return means;
}

Eigen::VectorXd ProfileStatistic::Expected(const ExpectedSet& set, int entry_index) const {
  const ProfileGroup& members = groups_[entry_index / blocks_];
  const std::vector<ExpectedFrame>& strips = set.strips[entry_index % blocks_];
  Eigen::VectorXd means(members.size);
  int entry = 0;
  for (size_t m = 0; m < members.frames.size(); ++m) {
    const ExpectedFrame& expected = strips[members.frames[m]];
    for (const ProfileBin& bin : members.bins[m]) {
      const PixelPlane& plane = planes_[bin.plane];
      double sum = 0;
      int count = 0;
      for (int row : bin.rows) {
        for (int c = plane.first_column; c < expected.mean_dn.columns_px; c += plane.step) {
          sum += expected.MeanDn(row, c);
          ++count;
        }
      }
      means[entry++] = sum / count;
    }
  }
  const ModelError& error = set.model_error;
  const double in_focus = error.Of(ModelError::kTailInFocus);
  const double out_of_focus = error.Of(ModelError::kTailOutOfFocus);
  if (in_focus != 0 || out_of_focus != 0) {
    const Eigen::VectorXd tails = Tails(means, members);
    entry = 0;
    for (size_t m = 0; m < members.frames.size(); ++m) {
      const auto size = static_cast<Eigen::Index>(members.bins[m].size());
      means.segment(entry, size) +=
          (members.in_focus[m] ? in_focus : out_of_focus) * tails.segment(entry, size);
      entry += static_cast<int>(size);
    }
  }
  return means;
}

Eigen::MatrixXd ProfileStatistic::Covariance(const ExpectedSet& set, int entry_index) const {
  const ProfileGroup& members = groups_[entry_index / blocks_];
  const std::vector<ExpectedFrame>& strips = set.strips[entry_index % blocks_];
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(members.size, members.size);
  Eigen::VectorXd noise_variance = Eigen::VectorXd::Zero(members.size);
  Eigen::VectorXd saturation_variance = Eigen::VectorXd::Zero(members.size);
  const ExpectedFrame& front = strips[members.frames.front()];
  const auto [first, last] = BlockColumns(members.columns_px, blocks_, entry_index % blocks_);
  const int middle = front.noise_variance_dn2.columns_px / 4 * 2;
  const size_t levels = front.level_dn.size();
  // Deviation of every level from the mean, of every row that is in a bin, at the block's middle.
  struct RowLevels {
    int entry, row, plane, place;
    double weight;
    std::vector<double> deviation;
  };
  std::vector<RowLevels> all;
  int entry = 0;
  for (size_t m = 0; m < members.frames.size(); ++m) {
    const ExpectedFrame& expected = strips[members.frames[m]];
    for (const ProfileBin& bin : members.bins[m]) {
      const PixelPlane& plane = planes_[bin.plane];
      const int columns = (last - first - plane.first_column + plane.step - 1) / plane.step;
      const double weight = 1.0 / static_cast<double>(bin.rows.size());
      double noise = 0;
      for (int row : bin.rows) {
        const int column = middle + plane.first_column;
        // What is odd about a pixel counts once.
        noise += expected.noise_variance_dn2.At(row, column) +
                 members.sharing * expected.pattern_variance_dn2.At(row, column);
        if (levels < 2) continue;
        RowLevels entry_row{entry, row, bin.plane, 0, weight, std::vector<double>(levels)};
        const double mean = expected.MeanDn(row, column);
        for (size_t q = 0; q < levels; ++q) {
          entry_row.deviation[q] = expected.level_dn[q].At(row, column) - mean;
        }
        all.push_back(std::move(entry_row));
      }
      const double top_dn = 0.99 * front.frame.sensor.largest_dn();
      double cut_off = 0;  // share of the levels
      for (const Image<float>& level : expected.level_dn) {
        cut_off += (level.At(bin.rows[bin.rows.size() / 2], middle + plane.first_column) > top_dn) /
                   static_cast<double>(levels);
      }
      saturation_variance[entry] =
          std::pow(kSaturationError * top_dn * 4 * cut_off * (1 - cut_off), 2);
      noise_variance[entry++] = noise * weight * weight / columns +
                                std::pow(expected.row_scatter_dn, 2) * weight +
                                std::pow(expected.column_scatter_dn, 2) / columns;
    }
  }
  const int step = planes_.front().step;
  if (levels < 2) {
    covariance = noise_variance.asDiagonal();
    if (members.preceding >= 0) {
      const Eigen::VectorXd left = ErrorOfWhatIsLeft(members, strips, (last - first) / step, step);
      covariance += left * left.transpose();
    }
    return covariance;
  }
  const MeanCorrelation correlation(*front.speckle, front.frame, (last - first) / step, step);
  const int lag = correlation.max_lag();
  for (RowLevels& each : all) each.place = correlation.PlaceOf(each.row);
  // Rows of all entries, sorted, so that only near ones meet.
  std::stable_sort(all.begin(), all.end(),
                   [](const RowLevels& a, const RowLevels& b) { return a.row < b.row; });
  for (size_t i = 0; i < all.size(); ++i) {
    for (size_t j = i; j < all.size() && all[j].row - all[i].row <= lag; ++j) {
      const int phase = planes_[all[j].plane].first_column - planes_[all[i].plane].first_column;
      const int distance = all[j].row - all[i].row;
      // Both rows' statistics, so that it stays a covariance.
      const double factor = 0.5 * (correlation.At(all[i].place, distance, phase) +
                                   correlation.At(all[j].place, distance, phase));
      double product = 0;
      for (size_t q = 0; q < levels; ++q) product += all[i].deviation[q] * all[j].deviation[q];
      const double value =
          product / static_cast<double>(levels) * factor * all[i].weight * all[j].weight;
      covariance(all[i].entry, all[j].entry) += value;
      if (i != j) covariance(all[j].entry, all[i].entry) += value;
    }
  }
  MakePositive(covariance);
  AddModelErrors(Expected(set, entry_index), members, blocks_, noise_variance, saturation_variance,
                 covariance);
  return covariance;
}

}  // namespace sightline
