// SPDX-License-Identifier: Apache-2.0
// Model of a whole set: parameters in, expected statistics out.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

struct SetParameters {
  SetupDeviation deviations;
  std::map<int, double> line_shift_px;  // of every plate position, besides the common one
  ModelError model_error;
  std::vector<ActiveEffect> effects;
};

struct SetModelSettings {
  int blocks_along_line = 4;
  int strip_columns_px = 2;  // even
  int speckle_levels = 12;
  int threads = 2;
};

// Vectors of all entries of all statistics, one statistic after the other.
using Entries = std::vector<Eigen::VectorXd>;

class SetModel {
 public:
  SetModel(const RecordedSet& set, const SetModelSettings& settings);

  const RecordedSet& set() const { return set_; }
  const std::vector<int>& position_ids() const { return position_ids_; }

  int entries() const { return static_cast<int>(observed_.size()); }
  const Entries& observed() const { return observed_; }
  // Which statistic an entry belongs to, and its number there.
  const SetStatistic& StatisticOf(int entry) const { return *statistics_[places_[entry].first]; }
  const std::vector<int>& FramesOf(int entry) const {
    return StatisticOf(entry).Frames(places_[entry].second);
  }

  // Plate position of all laser recordings that an entry is about; -1: none or several.
  int PlatePositionOf(int entry) const;
  // Recordings of one speckle, pixel by pixel.
  bool ComparesSpeckle(int entry) const { return StatisticOf(entry).compares_speckle(); }

  int FrameOfRow(int entry, int row) const {
    return StatisticOf(entry).FrameOfRow(places_[entry].second, row);
  }

  // Line position of every plate position, besides the parameters' deviations, by the centroid of
  // the line [px]: a start for the fit, which needs the line to within its width.
  std::map<int, double> EstimateLineShifts(const SetParameters& parameters) const;

  struct Expectation {
    Entries mean;
    std::vector<Eigen::MatrixXd> covariance;  // empty if not asked for
  };
  // `middle_only`: one block along the line stands for all; a quarter of the time, good enough for
  // derivatives with respect to deviations.
  Expectation Expect(const SetParameters& parameters, bool with_covariance,
                     bool middle_only = false) const;

  // The frames themselves, as strips in the middle of every block.
  ExpectedSet ExpectStrips(const SetParameters& parameters, bool middle_only) const;
  int blocks_along_line() const { return settings_.blocks_along_line; }

 private:
  const RecordedSet& set_;
  SetModelSettings settings_;
  std::vector<std::unique_ptr<SetStatistic>> statistics_;
  std::vector<std::pair<int, int>> places_;  // of every entry: statistic, entry of it
  Entries observed_;
  std::vector<int> position_ids_;
  std::vector<std::pair<int, int>> bursts_;  // first frame, one past the last
};

}  // namespace sightline
