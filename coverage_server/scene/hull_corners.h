// SPDX-License-Identifier: Apache-2.0
// Corners of the convex hull of a part, which may have millions of vertices.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "coverage_server/worker_process/worker_task.h"

namespace sightline {

// Computes the hull of many points in a separate process, if there is a program for it, because
// qhull cannot be stopped. Corners and their order do not depend on that. Errors as for
// MakeConvexHull() and RunWorkerTask(); CANCELLED soon after *cancelled.
absl::StatusOr<std::vector<Eigen::Vector3d>> HullCorners(std::span<const Eigen::Vector3f> points_m,
                                                         const std::atomic<bool>* cancelled);

// The task that runs in the separate process.
WorkerTask HullCornersTask();

}  // namespace sightline
