// SPDX-License-Identifier: Apache-2.0
// Two recordings of the same speckle with different exposure times, and the bins in which their
// pixels are compared. Bins and weights are nominal: they do not depend on the model's parameters.
#pragma once

#include <vector>

#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// With y_a, y_b the two images and r the ratio of their exposure times, pixels are binned by
// y_a + y_b and compared by y_b - r y_a. Shot noise of the sum and of that difference are
// uncorrelated, since a Poisson number given the sum of two is binomial; so the bins do not bias
// the difference.
struct ExposurePair {
  int first = 0, second = 0;     // recordings; `second` has the longer exposure
  double ratio = 1;              // r
  double offset_dn = 0;          // mean of both in the dark
  double gain_dn = 0;            // DN per electron
  double dark_noise = 0;         // variance of the difference in the dark [DN^2]
  double saturated_dn = 0;       // y_a from which y_b is certainly saturated; above the top: none
  std::vector<double> edges_dn;  // of the sum

  int bins() const { return static_cast<int>(edges_dn.size()) - 1; }
  // Components of a pair: the bins, the saturated pixels, the variance ratio.
  int size() const { return bins() + 2; }
  int saturated() const { return bins(); }
  int variance_ratio() const { return bins() + 1; }
  // Bin of a sum y_a + y_b; -1: outside all.
  int BinOf(double sum_dn) const;
  // Nominal variance of y_b - r y_a given the sum [DN^2].
  double NominalVariance(double sum_dn) const;
};

// One observation block of SharedSpeckleStatistic: the recordings of a plate position through the
// same optics, paired in order of exposure time. Components stand pair by pair.
struct SharedSpeckleBlock {
  std::vector<int> frames;  // in order of time
  std::vector<ExposurePair> pairs;
  int columns_px = 0;
  int size = 0;                        // components
  std::vector<double> observed_count;  // pixels per component; empty: the set is only planned
};

// Blocks of all plate positions with at least two such recordings.
std::vector<SharedSpeckleBlock> MakeSharedSpeckleBlocks(const RecordedSet& set);

}  // namespace sightline
