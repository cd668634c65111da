// SPDX-License-Identifier: Apache-2.0
// A kind of observable of a set: the same numbers from recordings and from the model.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// What the model itself is not sure of, alike in all recordings, over its standard uncertainty:
// light far from the line, in recordings in focus and out of focus, beyond what the model gives it,
// over what it leaves at the region's edge (light that leaves one side of a simulated grid comes
// back on the other; lenses scatter some); the squared contrast of speckle, relative.
struct ModelError {
  static constexpr int kTailInFocus = 0, kTailOutOfFocus = 1, kContrast = 2, kCount = 3;
  static constexpr std::array<double, kCount> kUncertainty = {0.5, 0.5, 0.02};
  std::array<double, kCount> standardised{};

  double Of(int error) const { return kUncertainty[error] * standardised[error]; }
};

// What the model expects of a set: a strip in the middle of every block along the line stands for
// the block.
struct ExpectedSet {
  std::vector<std::vector<ExpectedFrame>> strips;  // [block][frame]
  std::vector<ActiveEffect> effects;
  ModelError model_error;
};

// Its numbers come in entries that are independent of each other; within an entry they have a
// covariance.
class SetStatistic {
 public:
  virtual ~SetStatistic() = default;
  virtual std::string_view name() const = 0;
  virtual int entries() const = 0;
  // True: recordings of one speckle, pixel by pixel.
  virtual bool compares_speckle() const { return false; }
  // Recordings an entry is computed from, in order of time.
  virtual const std::vector<int>& Frames(int entry) const = 0;
  // Recording that number `row` of an entry is about.
  virtual int FrameOfRow(int entry, int /*row*/) const { return Frames(entry).back(); }
  virtual Eigen::VectorXd Observed(const RecordedSet& set, int entry) const = 0;
  virtual Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const = 0;
  virtual Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const = 0;
};

}  // namespace sightline
