// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/fixed_pattern_statistic.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "render_worker/diagnosis/statistic/pattern/dark_pattern.h"
#include "render_worker/diagnosis/statistic/pattern/sensitivity_pattern.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Variance of rounding [DN^2]: that of a uniform distribution over one raw value.
constexpr double kQuantisationVariance_dn2 = 1.0 / 12;

// Least width of a region that is divided into parts: a stripe each.
constexpr int kLeastColumns_px = kObservedParts * kStripe_px;

// Takes the recording with the middle exposure of each plate position (or dark frame).
PatternGroup MakeGroup(const RecordedSet& set, bool laser,
                       const std::map<int, std::vector<int>>& positions) {
  PatternGroup group;
  group.laser = laser;
  for (const auto& [position, frames] : positions) {
    std::vector<int> order = frames;
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return set.frames[a].nominal.exposure_time_s < set.frames[b].nominal.exposure_time_s;
    });
    group.frames.push_back(order[order.size() / 2]);
  }
  std::sort(group.frames.begin(), group.frames.end());
  const FrameSetup& front = set.frames[group.frames.front()].nominal;
  const Sensor& sensor = front.sensor;
  group.roi = front.roi;
  group.offset_dn = DarkMeanDn(sensor);
  group.noise_dn =
      std::sqrt(std::pow(sensor.gain_dn_per_electron * sensor.dark_noise_electrons, 2) +
                kQuantisationVariance_dn2);
  for (size_t i = 0; i < group.frames.size(); ++i) {
    const RecordedFrame& recorded = set.frames[group.frames[i]];
    if (recorded.nominal.exposure_time_s >
        set.frames[group.frames[group.longest]].nominal.exposure_time_s) {
      group.longest = i;
    }
    if (laser && !recorded.raw_dn.empty()) {
      group.weights.push_back(MakeRelativeResiduals(recorded.raw_dn, group.offset_dn,
                                                    sensor.largest_dn(), kPatternSegments)
                                  .weights);
    }
  }
  return group;
}

}  // namespace

FixedPatternStatistic::FixedPatternStatistic(const RecordedSet& set) {
  // Recordings of the same region, by plate position; every dark frame counts as a position.
  using Key = std::tuple<bool, int, int, int, int>;
  std::map<Key, std::map<int, std::vector<int>>> regions;
  for (int f = 0; f < static_cast<int>(set.frames.size()); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    const RegionOfInterest& roi = recorded.nominal.roi;
    const bool laser = recorded.plate_position_id >= 0;
    regions[{laser, roi.column_px, roi.row_px, roi.columns_px, roi.rows_px}]
           [laser ? recorded.plate_position_id : f]
               .push_back(f);
  }
  for (const auto& [key, positions] : regions) {
    if (positions.size() >= 2) groups_.push_back(MakeGroup(set, std::get<0>(key), positions));
  }
}

int FixedPatternStatistic::FrameOfComponent(int block, int component) const {
  const PatternGroup& group = groups_[block];
  // Counts of outliers belong to one recording each, the other components to all.
  return group.laser || component < kDarkProducts ? group.frames.back()
                                                  : group.frames[component - kDarkProducts];
}

Eigen::VectorXd FixedPatternStatistic::Observed(const RecordedSet& set, int block) const {
  const PatternGroup& group = groups_[block];
  return group.laser ? ObservedSensitivity(set, group) : ObservedDarkPattern(set, group);
}

std::vector<Eigen::VectorXd> FixedPatternStatistic::ObservedOfParts(const RecordedSet& set,
                                                                    int block) const {
  const PatternGroup& group = groups_[block];
  if (group.roi.columns_px < kLeastColumns_px) return {};
  return group.laser ? ObservedSensitivityOfParts(set, group)
                     : ObservedDarkPatternOfParts(set, group);
}

Eigen::VectorXd FixedPatternStatistic::Expected(const ExpectedSet& expected, int block) const {
  const PatternGroup& group = groups_[block];
  return group.laser ? ExpectedSensitivity(expected, group) : ExpectedDarkPattern(expected, group);
}

Eigen::MatrixXd FixedPatternStatistic::Covariance(const ExpectedSet& expected, int block) const {
  const PatternGroup& group = groups_[block];
  return group.laser ? CovarianceOfSensitivity(expected, group)
                     : CovarianceOfDarkPattern(expected, group);
}

}  // namespace sightline
