// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/profile_statistic.h"

#include <map>
#include <utility>

#include "render_worker/diagnosis/statistic/profile_covariance.h"
#include "render_worker/diagnosis/statistic/profile_model_error.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

namespace {

// Radius of the blur up to which a line counts as in focus [px]. Chosen: about the width of the
// line.
constexpr double kInFocus_px = 2;

// Frame of a group and bin of that frame that a component belongs to.
std::pair<size_t, int> FrameAndBin(const ProfileGroup& group, int component) {
  size_t m = 0;
  while (component >= static_cast<int>(group.bins[m].size())) {
    component -= static_cast<int>(group.bins[m++].size());
  }
  return {m, component};
}

}  // namespace

ProfileStatistic::ProfileStatistic(const RecordedSet& set, int segments_along_line)
    : segments_(segments_along_line), planes_(PixelPlanes(set.frames.front().nominal.sensor)) {
  std::map<int, int> group_of_position;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    int index = static_cast<int>(groups_.size());
    if (recorded.plate_position_id >= 0) {
      index = group_of_position.emplace(recorded.plate_position_id, index).first->second;
    }
    if (index == static_cast<int>(groups_.size())) groups_.emplace_back();
    ProfileGroup& group = groups_[index];
    group.frames.push_back(static_cast<int>(f));
    group.in_focus.push_back(DefocusRadiusPx(recorded.nominal) < kInFocus_px);
    group.columns_px = recorded.nominal.roi.columns_px;
    const int before = PrecedingFrame(set, static_cast<int>(f));
    if (recorded.plate_position_id < 0 && before >= 0 &&
        set.frames[before].plate_position_id >= 0) {
      group.preceding = before;
    }
    std::vector<ProfileBin> bins = MakeProfileBins(recorded, planes_);
    group.size += static_cast<int>(bins.size());
    group.bins.push_back(std::move(bins));
  }
  std::map<std::pair<int, int>, int> groups_at;  // column and row of the sensor
  const auto corner = [&](const ProfileGroup& group) {
    const RegionOfInterest& roi = set.frames[group.frames.front()].nominal.roi;
    return std::pair(roi.column_px, roi.row_px);
  };
  for (const ProfileGroup& group : groups_) ++groups_at[corner(group)];
  for (ProfileGroup& group : groups_) group.sharing = groups_at[corner(group)];
}

int ProfileStatistic::FrameOfComponent(int block, int component) const {
  const ProfileGroup& group = groups_[block / segments_];
  return group.frames[FrameAndBin(group, component).first];
}

double ProfileStatistic::OffsetOfComponent(int block, int component) const {
  const ProfileGroup& group = groups_[block / segments_];
  const auto [m, bin] = FrameAndBin(group, component);
  return group.bins[m][bin].centre_px;
}

Eigen::VectorXd ProfileStatistic::Observed(const RecordedSet& set, int block) const {
  const ProfileGroup& group = groups_[block / segments_];
  Eigen::VectorXd means(group.size);
  int component = 0;
  for (size_t m = 0; m < group.frames.size(); ++m) {
    const Image<uint16_t>& raw = set.frames[group.frames[m]].raw_dn;
    const auto [first, last] = BlockColumns(raw.columns_px, segments_, block % segments_);
    for (const ProfileBin& bin : group.bins[m]) {
      const PixelPlane& plane = planes_[bin.plane];
      double sum = 0;
      int count = 0;
      for (int row : bin.rows) {
        for (int column = first + plane.first_column; column < last; column += plane.step) {
          sum += raw.At(row, column);
          ++count;
        }
      }
      means[component++] = sum / count;
    }
  }
  return means;
}

Eigen::VectorXd ProfileStatistic::Expected(const ExpectedSet& expected, int block) const {
  const ProfileGroup& group = groups_[block / segments_];
  const std::vector<ExpectedFrame>& samples = expected.strips[block % segments_];
  Eigen::VectorXd means(group.size);
  int component = 0;
  for (size_t m = 0; m < group.frames.size(); ++m) {
    const ExpectedFrame& sample = samples[group.frames[m]];
    for (const ProfileBin& bin : group.bins[m]) {
      const PixelPlane& plane = planes_[bin.plane];
      double sum = 0;
      int count = 0;
      for (int row : bin.rows) {
        for (int c = plane.first_column; c < sample.mean_dn.columns_px; c += plane.step) {
          sum += sample.MeanDn(row, c);
          ++count;
        }
      }
      means[component++] = sum / count;
    }
  }
  const ModelError& error = expected.model_error;
  const double in_focus = error.Of(ModelError::kTailInFocus);
  const double out_of_focus = error.Of(ModelError::kTailOutOfFocus);
  if (in_focus == 0 && out_of_focus == 0) return means;
  const Eigen::VectorXd signals = EdgeSignals(means, group);
  component = 0;
  for (size_t m = 0; m < group.frames.size(); ++m) {
    const auto size = static_cast<Eigen::Index>(group.bins[m].size());
    means.segment(component, size) +=
        (group.in_focus[m] ? in_focus : out_of_focus) * signals.segment(component, size);
    component += static_cast<int>(size);
  }
  return means;
}

Eigen::MatrixXd ProfileStatistic::Covariance(const ExpectedSet& expected, int block) const {
  const ProfileGroup& group = groups_[block / segments_];
  const auto [first, last] = BlockColumns(group.columns_px, segments_, block % segments_);
  return ProfileCovariance(group, planes_, expected.strips[block % segments_], last - first,
                           segments_, Expected(expected, block));
}

}  // namespace sightline
