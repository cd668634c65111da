// SPDX-License-Identifier: Apache-2.0
// Recordings of the same region of the sensor that FixedPatternStatistic compares: one observation
// block.
#pragma once

#include <utility>
#include <vector>

#include "render_worker/diagnosis/statistic/pattern/relative_residuals.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

// Segments along the line about whose means residuals are taken. Chosen as for the set's model.
inline constexpr int kPatternSegments = 4;

// Least width of a stripe of columns [px]. Chosen: wider than speckle is correlated over.
inline constexpr int kStripe_px = 24;

// First column and one past the last.
using ColumnSpan = std::pair<int, int>;
// Columns of part `part` of kObservedParts (SetStatistic::ObservedOfParts) of a region: stripes of
// equal width, dealt to the parts in turn, so that light and patterns that vary along the line are
// alike in all parts. The last `lag_px` columns are left out; they have no pixel a lag away.
// `columns_px` must be at least kObservedParts * kStripe_px, and larger than `lag_px`.
inline std::vector<ColumnSpan> ColumnsOfPart(int columns_px, int lag_px, int part) {
  const int stripes = columns_px / (kObservedParts * kStripe_px);  // of each part
  std::vector<ColumnSpan> spans;
  for (int i = 0; i < stripes; ++i) {
    spans.push_back(
        BlockColumns(columns_px - lag_px, kObservedParts * stripes, kObservedParts * i + part));
  }
  return spans;
}

struct PatternGroup {
  std::vector<int> frames;  // in order of time; with laser one of each plate position
  bool laser = false;
  RegionOfInterest roi;
  double offset_dn = 0;  // nominal mean in the dark
  double noise_dn = 0;   // nominal standard deviation in the dark
  size_t longest = 0;    // of dark frames: index into `frames` of the longest exposure
  // With laser, of every recording; empty: the set is only planned.
  std::vector<RowWeights> weights;
};

}  // namespace sightline
