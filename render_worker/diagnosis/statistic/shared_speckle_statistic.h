// SPDX-License-Identifier: Apache-2.0
// Recordings of one plate position share their speckle: pixel by pixel, one exposure predicts the
// other, and what remains is temporal noise. Speckle, the profile of the line and its width cancel,
// so the response of the sensor and the exposure times show as in a photon transfer measurement.
#pragma once

#include <span>
#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Mean squared change of the pixels between two recordings of one speckle over twice its variance:
// 1 - correlation of the two, for what the effects move between or during them; the loss of
// contrast of each by its own movement included.
double SpeckleDecorrelation(const ExpectedFrame& a, const ExpectedFrame& b,
                            std::span<const ActiveEffect> effects);

// Entry per plate position with several recordings through the same optics, which are paired in
// order of exposure time. With y_a, y_b the two images and r the ratio of their exposure times:
//   - mean of y_b - r y_a [DN] over the pixels of each bin of y_a + y_b. Shot noise of the sum and
//     of that difference are uncorrelated (a Poisson number given the sum of two is binomial), so
//     the bins do not bias it;
//   - mean of y_b [DN] over the pixels that must be saturated there by what y_a shows;
//   - variance of y_b - r y_a within the bins over what shot noise and dark noise make of it
//     nominally: 1, more if the speckle has moved between the recordings.
class SharedSpeckleStatistic : public SetStatistic {
 public:
  explicit SharedSpeckleStatistic(const RecordedSet& set);

  std::string_view name() const override { return "shared speckle"; }
  bool compares_speckle() const override { return true; }
  int entries() const override { return static_cast<int>(entries_.size()); }
  const std::vector<int>& Frames(int entry) const override { return entries_[entry].frames; }
  int FrameOfRow(int entry, int row) const override;
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  // Nominal numbers that define the bins, whatever the model's parameters are.
  struct Pair {
    int first = 0, second = 0;  // frames, the longer exposure last
    double ratio = 1;
    double offset_dn = 0;          // mean of both in the dark
    double gain_dn = 0;            // DN per electron
    double dark_noise = 0;         // variance of the difference in the dark [DN^2]
    double saturated_dn = 0;       // y_a that means a saturated y_b; above the top: none
    std::vector<double> edges_dn;  // of the sum

    int bins() const { return static_cast<int>(edges_dn.size()) - 1; }
    int size() const { return bins() + 2; }
    // Variance of y_b - r y_a for this sum.
    double NominalVariance(double sum_dn) const;
  };
  struct Entry {
    std::vector<int> frames;
    std::vector<Pair> pairs;
    int columns_px = 0;
    int size = 0;
    std::vector<double> observed_count;  // pixels; empty: not recorded yet
  };
  struct Moments;
  // `with_common`: with what neighbouring pairs have in common, which the covariance needs only.
  Moments Evaluate(const ExpectedSet& expected, const Entry& entry, bool with_common) const;
  static void AddRowScatter(const ExpectedSet& expected, const Entry& entry, const Moments& moments,
                            Eigen::MatrixXd& covariance);

  std::vector<Entry> entries_;
};

}  // namespace sightline
