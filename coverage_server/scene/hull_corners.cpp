// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/scene/hull_corners.h"

#include <utility>

#include "core/resting/convex_hull.h"
#include "core/status/status_macros.h"
#include "coverage_server/worker_process/worker_process.h"

namespace sightline {
namespace {

constexpr char kHullCornersTask[] = "hull-corners";
// Takes less than 100 ms even if all of them are corners.
constexpr size_t kMostPointsHere = 10'000;

}  // namespace

WorkerTask HullCornersTask() {
  return {kHullCornersTask, [](SharedReader& input, SharedWriter& answer) -> absl::Status {
            SIGHTLINE_ASSIGN_OR_RETURN(const auto hull,
                                       MakeConvexHull(input.GetAll<Eigen::Vector3f>()));
            answer.PutAll(std::span(hull.corners_m.data()->data(), 3 * hull.corners_m.size()));
            return absl::OkStatus();
          }};
}

absl::StatusOr<std::vector<Eigen::Vector3d>> HullCorners(std::span<const Eigen::Vector3f> points_m,
                                                         const std::atomic<bool>* cancelled) {
  const std::string program = WorkerProgram();
  if (program.empty() || points_m.size() <= kMostPointsHere) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto hull, MakeConvexHull(points_m));
    return std::move(hull.corners_m);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto input, SharedMemory::Make("sightline-hull", 0));
  SharedWriter writer(input.fd(), cancelled);
  writer.PutAll(std::span(points_m.data()->data(), 3 * points_m.size()));
  if (!writer.status().ok()) return writer.status();
  SIGHTLINE_ASSIGN_OR_RETURN(auto answer,
                             RunWorkerTask(program, kHullCornersTask, input, cancelled));
  const auto corners = answer.GetAll<Eigen::Vector3d>();
  if (!answer.ok()) return absl::InternalError("the hull is not whole");
  return std::vector<Eigen::Vector3d>(corners.begin(), corners.end());
}

}  // namespace sightline
