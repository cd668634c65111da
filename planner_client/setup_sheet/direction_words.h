// SPDX-License-Identifier: Apache-2.0
// Directions of the machine as text for people beside it. World axes: x is the stage's travel, z is
// up.
#pragma once

#include <Eigen/Core>
#include <string>

namespace sightline {

// Direction from the origin to `place` (any length but 0) as text: "straight above", "38° from
// vertical, towards +y", "38° from vertical, 25° from +x towards +y", "12° below the horizontal,
// towards −x". Angles are rounded to degrees; a direction within half a degree of an axis counts as
// on it.
std::string PlaceInWords(const Eigen::Vector3d& place);

// Direction of an axis in words: "up", "towards +x", "12° above the horizontal, towards +y".
std::string PointsInWords(const Eigen::Vector3d& direction);

}  // namespace sightline
