// SPDX-License-Identifier: Apache-2.0
// Model of a whole set of recordings: parameters in, expected statistics out.
//
// A statistic (SetStatistic) is computed in observation blocks: vectors of components with a common
// covariance, independent of the components of other blocks. The model numbers the blocks of all
// statistics one after the other.
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
  // By plate position, in addition to the deviation that all positions have in common.
  std::map<int, double> line_shift_px;
  ModelError model_error;
  std::vector<ActiveEffect> effects;
};

struct SetModelSettings {
  // Segments along the line; a narrow column sample in the middle of each is computed and stands
  // for it. Chosen: fields change slowly along the line, and four show a gradient and its
  // curvature.
  int blocks_along_line = 4;
  int strip_columns_px = 2;  // of a column sample; even, so that a colour sensor's cells are whole
  int speckle_levels = 12;   // equally likely levels of speckle at which a pixel is evaluated
  int threads = 2;
  // Effects that every expectation contains in addition to those of its parameters.
  std::vector<ActiveEffect> present_effects = {};
};

// One vector per observation block, of all statistics one after the other.
using BlockVectors = std::vector<Eigen::VectorXd>;

// The change of every expectation of a model, and the covariance of its error, which is added to
// every covariance. One vector and one matrix per observation block.
struct ExpectationCorrection {
  BlockVectors mean;
  std::vector<Eigen::MatrixXd> covariance;
};

class SetModel {
 public:
  // Computes the statistics of the recordings, if the set has any; a planned set has none, and its
  // observed() are empty vectors. `set` must outlive the model.
  SetModel(const RecordedSet& set, const SetModelSettings& settings);
  // `model` with a correction, which must have its sizes. Both share the statistics.
  SetModel(const SetModel& model, ExpectationCorrection correction);

  const RecordedSet& set() const { return set_; }
  const std::vector<int>& position_ids() const { return position_ids_; }

  int blocks() const { return static_cast<int>(observed_.size()); }
  const BlockVectors& observed() const { return observed_; }
  // True: the expectation has a correction, and the covariance contains the model's own errors.
  bool is_corrected() const { return !correction_.mean.empty(); }
  // Statistics of other images of the same recordings, such as renderings of them. Bins, pixels and
  // sizes are those chosen from the recordings of set(), so that they compare with observed().
  BlockVectors StatisticsOf(const RecordedSet& images) const;
  // SetStatistic::ObservedOfParts of a block.
  const BlockVectors& ObservedParts(int block) const { return observed_parts_[block]; }
  // The statistic that a block belongs to.
  const SetStatistic& StatisticOf(int block) const { return *statistics_[places_[block].first]; }
  // Recordings that a block is computed from, in order of time.
  const std::vector<int>& FramesOf(int block) const {
    return StatisticOf(block).Frames(places_[block].second);
  }

  // Recording that a component of a block belongs to.
  int FrameOfComponent(int block, int component) const {
    return StatisticOf(block).FrameOfComponent(places_[block].second, component);
  }

  struct Expectation {
    BlockVectors mean;
    std::vector<Eigen::MatrixXd> covariance;  // empty if not asked for
  };
  // Expected components of every block, and their covariances if asked for. `middle_only`: the
  // middle segment along the line stands for all. That takes a quarter of the time and suffices for
  // derivatives with respect to deviations.
  Expectation Expect(const SetParameters& parameters, bool with_covariance,
                     bool middle_only = false) const;

  // The expected frames: a column sample in the middle of every segment along the line. If the
  // effects act differently on some recordings only, `changed` saves the others: their samples are
  // taken from `before`, which has all other parameters in common. Numbers are the same either way.
  struct ChangedRecordings {
    const ExpectedSet& before;
    std::vector<bool> changed;  // of every recording
  };
  ExpectedSet ExpectStrips(const SetParameters& parameters, bool middle_only,
                           const ChangedRecordings* changed = nullptr) const;
  // Expected components of the blocks in `use` (empty: all); the others are empty vectors.
  BlockVectors MeanOf(const ExpectedSet& expected, const std::vector<bool>& use) const;
  // Effects of the expectation: those of the parameters, and those that are always present.
  std::vector<ActiveEffect> EffectsOf(const SetParameters& parameters) const;
  int blocks_along_line() const { return settings_.blocks_along_line; }
  int threads() const { return settings_.threads; }

 private:
  // Expected components of a block, with the correction.
  Eigen::VectorXd MeanOfBlock(const ExpectedSet& expected, int block) const;

  const RecordedSet& set_;
  SetModelSettings settings_;
  std::vector<std::shared_ptr<const SetStatistic>> statistics_;
  std::vector<std::pair<int, int>> places_;  // of every block: statistic, block of it
  BlockVectors observed_;
  std::vector<BlockVectors> observed_parts_;  // of every block
  std::vector<int> position_ids_;
  std::vector<std::pair<int, int>> bursts_;  // first frame, one past the last
  ExpectationCorrection correction_;         // empty: none
};

// Plate position of all laser recordings of a block; -1: none or several.
int PlatePositionOf(const SetModel& model, int block);

// Line shift of every plate position in addition to the parameters' deviations, from the centroid
// of the line [px]. It starts the fit, which needs the line to within its width.
std::map<int, double> EstimateLineShifts(const SetModel& model, const SetParameters& parameters);

}  // namespace sightline
