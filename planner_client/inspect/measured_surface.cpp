// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspect/measured_surface.h"

#include <Eigen/Geometry>

#include "core/statistics/covariance_root.h"
#include "core/status/status_macros.h"
#include "core/targets/poisson_disk.h"

namespace sightline {

PlanKnowledge MeasuredSurface::Knowledge() const {
  PlanKnowledge knowledge;
  knowledge.targets = &targets;
  knowledge.measurable = nullptr;
  const size_t scans = estimates.empty() ? 0 : estimates.front().scan_weights.size();
  knowledge.density.assign(scans, std::vector<float>(targets.size()));
  for (size_t t = 0; t < estimates.size(); ++t) {
    knowledge.uncertainty.push_back(estimates[t].parts);
    knowledge.points.push_back(estimates[t].points);
    for (size_t s = 0; s < scans; ++s) knowledge.density[s][t] = estimates[t].scan_weights[s];
  }
  return knowledge;
}

absl::StatusOr<MeasuredSurface> EstimateSurface(const TriangleMesh& model,
                                                const Inspection& inspection,
                                                const MeasuredPart& part, int threads) {
  MeasuredSurface surface;
  SIGHTLINE_ASSIGN_OR_RETURN(surface.targets, SampleTargets(model, inspection.targets));
  surface.estimates = EstimateDeviations(
      surface.targets, PriorsOf(surface.targets, inspection.targets, *inspection.uncertainty),
      inspection.targets.max_normal_angle_rad, part.ScanPointers(), threads);
  const auto count = static_cast<Eigen::Index>(surface.targets.size());
  Eigen::MatrixXd by_pose(count, 6);
  for (Eigen::Index t = 0; t < count; ++t) {
    const auto i = static_cast<size_t>(t);
    const Eigen::Vector3d normal = surface.targets.normals[i].cast<double>();
    const Eigen::Vector3d arm =
        surface.targets.positions_m[i].cast<double>() - part.registration.pose.centre_m;
    by_pose.row(t) << arm.cross(normal).transpose(), normal.transpose();
  }
  surface.pose_deviations_m = by_pose * CovarianceRoot(part.registration.covariance);
  return surface;
}

}  // namespace sightline
