// SPDX-License-Identifier: Apache-2.0
// Pattern of the pixels' relative sensitivity, seen on the laser line: the block of
// FixedPatternStatistic for recordings with laser.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/statistic/pattern/pattern_group.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// All have kLagCount components: the mean products of relative residuals at every lag.
Eigen::VectorXd ObservedSensitivity(const RecordedSet& set, const PatternGroup& group);
// The same of every part (SetStatistic::ObservedOfParts). A product belongs to the part of its left
// pixel (ColumnsOfPart), so that all parts have the same number of products at every lag. Empty:
// the set is only planned.
std::vector<Eigen::VectorXd> ObservedSensitivityOfParts(const RecordedSet& set,
                                                        const PatternGroup& group);
Eigen::VectorXd ExpectedSensitivity(const ExpectedSet& expected, const PatternGroup& group);
Eigen::MatrixXd CovarianceOfSensitivity(const ExpectedSet& expected, const PatternGroup& group);

}  // namespace sightline
