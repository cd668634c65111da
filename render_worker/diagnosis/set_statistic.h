// A kind of observable of a set: the same numbers from recordings and from the model.
#pragma once

#include <Eigen/Core>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/expected_frame.h"
#include "render_worker/diagnosis/recorded_set.h"

namespace sightline {

// What the model expects of a set: a strip in the middle of every block along the line stands for
// the block.
struct ExpectedSet {
  std::vector<std::vector<ExpectedFrame>> strips;  // [block][frame]
  std::vector<ActiveEffect> effects;
};

// Its numbers come in entries that are independent of each other; within an entry they have a
// covariance.
class SetStatistic {
 public:
  virtual ~SetStatistic() = default;
  virtual std::string_view name() const = 0;
  virtual int entries() const = 0;
  // Recordings an entry is computed from, in order of time.
  virtual const std::vector<int>& Frames(int entry) const = 0;
  // Recording that number `row` of an entry is about.
  virtual int FrameOfRow(int entry, int /*row*/) const { return Frames(entry).back(); }
  virtual Eigen::VectorXd Observed(const RecordedSet& set, int entry) const = 0;
  virtual Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const = 0;
  virtual Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const = 0;
};

}  // namespace sightline
