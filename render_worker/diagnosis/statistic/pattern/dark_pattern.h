// SPDX-License-Identifier: Apache-2.0
// Pattern of the pixels' offsets and dark currents: the block of FixedPatternStatistic for dark
// frames.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/statistic/pattern/pattern_group.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Components before the counts of outliers, of which there is one per recording.
inline constexpr int kDarkProducts = 2;

// All are in units of the nominal dark noise. Components:
//   0  mean product of the pixels' clipped residuals over pairs of recordings;
//   1  that of the columns' means, without the pixels' own part;
//   2 ...  for every recording the Anscombe transform of the number of pixels that are outliers
//   both
//      there and in the longest exposure.
Eigen::VectorXd ObservedDarkPattern(const RecordedSet& set, const PatternGroup& group);
// Components 0 and 1 of every part (SetStatistic::ObservedOfParts), by ColumnsOfPart. The
// transformed counts are left out, because their expectation depends on the area. Empty: the set is
// only planned.
std::vector<Eigen::VectorXd> ObservedDarkPatternOfParts(const RecordedSet& set,
                                                        const PatternGroup& group);
Eigen::VectorXd ExpectedDarkPattern(const ExpectedSet& expected, const PatternGroup& group);
Eigen::MatrixXd CovarianceOfDarkPattern(const ExpectedSet& expected, const PatternGroup& group);

}  // namespace sightline
