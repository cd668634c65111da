// SPDX-License-Identifier: Apache-2.0
// Statistics: observables that are computed from recordings and expected by the model.
//
// A statistic consists of observation blocks: vectors of components with a common covariance,
// independent of other blocks. The set's model (fit/set_model.h) compares Observed with Expected
// under Covariance. A new statistic is a class derived from SetStatistic, a StatisticKind, and a
// line in the constructor of SetModel.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Nuisance parameters for known model errors, common to all recordings, in units of their prior
// standard deviation:
//   - light far from the line in addition to the modelled one, in recordings in focus and out of
//     focus, relative to the signal at the region's edge. A simulated grid is periodic, so light
//     that leaves it on one side comes back on the other; lenses scatter light too;
//   - relative error of the squared contrast of speckle.
struct ModelError {
  static constexpr int kTailInFocus = 0, kTailOutOfFocus = 1, kContrast = 2, kCount = 3;
  // Prior standard deviations. Chosen for the tails; that of the contrast as measured
  // (noise/texture_statistic.cpp).
  static constexpr std::array<double, kCount> kUncertainty = {0.5, 0.5, 0.02};
  std::array<double, kCount> standardised{};

  double Of(int error) const { return kUncertainty[error] * standardised[error]; }
};

// The expectation of a set. A narrow column sample in the middle of every segment along the line
// stands for the segment.
struct ExpectedSet {
  std::vector<std::vector<ExpectedFrame>> strips;  // [segment][frame]
  std::vector<ActiveEffect> effects;
  ModelError model_error;
};

// One value per statistic of the library.
enum class StatisticKind {
  kProfile,        // mean profile across the line (ProfileStatistic)
  kTexture,        // variance and correlation of speckle (TextureStatistic)
  kTemporalNoise,  // differences of repeated recordings (RepeatStatistic)
  kDarkFrames,     // variances of dark frames (DarkStatistic)
  kFixedPattern,   // patterns that stay on the sensor (FixedPatternStatistic)
  kSharedSpeckle,  // exposures of the same speckle compared by pixel (SharedSpeckleStatistic)
  kBurst,          // image lag within a burst (BurstStatistic)
  kHistogram,      // frequencies of raw values (HistogramStatistic)
  kColumnParity,   // odd against even columns (ColumnParityStatistic)
};

// Parts of the pixels that an observation block can be divided into. Chosen: as many as there are
// folds of the cross-validation (fit/fit_quality.h), so that each fold holds out one part.
inline constexpr int kObservedParts = 4;

// Block indices are 0 ... blocks() - 1.
class SetStatistic {
 public:
  virtual ~SetStatistic() = default;
  virtual StatisticKind kind() const = 0;
  // Name in reports and in names of groups of a predictive check.
  virtual std::string_view name() const = 0;
  virtual int blocks() const = 0;
  // True: compares recordings of the same speckle pixel by pixel.
  virtual bool compares_speckle() const { return false; }
  // Recordings that a block is computed from, in order of time.
  virtual const std::vector<int>& Frames(int block) const = 0;
  // Recording that component `component` of a block belongs to.
  virtual int FrameOfComponent(int block, int /*component*/) const { return Frames(block).back(); }
  // Components of a block from the recordings, and their expectation and covariance by the model.
  // All have the same size, which depends on the recordings alone.
  virtual Eigen::VectorXd Observed(const RecordedSet& set, int block) const = 0;
  virtual Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const = 0;
  // The leading m components of a block, computed on each of kObservedParts disjoint parts of the
  // pixels: all of size m <= Observed().size(). Empty (the default): the block is not divided, or
  // the set is only planned. Each part has the expectation of the block's leading components. Parts
  // count as independent with kObservedParts times the block's covariance, so that together they
  // are as informative as the block. That is an approximation in two respects: pixels within a lag
  // of the border between two parts contribute to both, and those errors of the model that all
  // parts share count as independent.
  virtual std::vector<Eigen::VectorXd> ObservedOfParts(const RecordedSet& /*set*/,
                                                       int /*block*/) const {
    return {};
  }
  virtual Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const = 0;
};

}  // namespace sightline
