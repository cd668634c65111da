// SPDX-License-Identifier: Apache-2.0
// Convex hull of a part (qhull: Barber, Dobkin, Huhdanpaa 1996, "The Quickhull algorithm for convex
// hulls", ACM TOMS 22(4)).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct ConvexHull {
  std::vector<Eigen::Vector3d> corners_m;
  std::vector<std::array<uint32_t, 3>> triangles;  // counter-clockwise seen from outside
};

// INVALID_ARGUMENT if the points lie in a plane (within rounding) or are fewer than four.
absl::StatusOr<ConvexHull> MakeConvexHull(std::span<const Eigen::Vector3f> points_m);

// Largest distance along `direction`, of any length, over the points; -infinity for none.
double SupportHeight(std::span<const Eigen::Vector3d> points_m, const Eigen::Vector3d& direction);

}  // namespace sightline
