// SPDX-License-Identifier: Apache-2.0
// Directions of the machine in words that people use beside it. World axes: x the stage's travel, z
// up.
#pragma once

#include <Eigen/Core>
#include <string>

namespace sightline {

// Direction of `place` (any length but 0) from the origin, in words:
// "straight above", "38° from vertical, towards +y", "38° from vertical, 25° from +x towards +y",
// "12° below the horizontal, towards −x". Angles are rounded to degrees; what is within half a
// degree of an axis is said to be on it.
std::string PlaceInWords(const Eigen::Vector3d& place);

// Direction of an axis in words: "up", "towards +x", "12° above the horizontal, towards +y".
std::string PointsInWords(const Eigen::Vector3d& direction);

}  // namespace sightline
