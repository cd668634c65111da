// SPDX-License-Identifier: Apache-2.0
// Views of a target that are repeated. A repeated view adds nothing to a calibration, and a frame
// that is left out would be predicted from its own copy.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

namespace sightline {

// Corners of two views that differ by less than this (root mean square) are of one view. Six times
// the scatter of corners of a real scanner, 0.5 px (docs/proof.md, line sensor on a robot).
inline constexpr double kSameView_px = 3;

struct RepeatedView {
  size_t of = 0;  // the earlier view
  double corners_rms_px = 0;
};

// `corners_px`: corners of each view in the same order; empty where the target was not found.
// Unset: the first view of its kind, or one without corners. Views with other numbers of corners
// differ.
std::vector<std::optional<RepeatedView>> FindRepeatedViews(
    const std::vector<std::vector<Eigen::Vector2d>>& corners_px);

}  // namespace sightline
