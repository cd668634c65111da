// SPDX-License-Identifier: Apache-2.0
// Deviations of the surface of a measured part at the targets of its inspection.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/registration/surface_deviation.h"
#include "core/targets/target_set.h"
#include "planner_client/replanning/measured_part.h"
#include "planning/requirements/known_targets.h"

namespace sightline {

struct MeasuredSurface {
  TargetSet targets;  // on the CAD model, those that a plan of the inspection has
  std::vector<DeviationEstimate> estimates;
  // Deviations [m] (rows: targets) that independent errors of the pose of one standard deviation
  // cause (six columns at most). By the covariance of the registration.
  Eigen::MatrixXd pose_deviations_m;

  // As a plan's knowledge: each scan's weight in the estimates takes the place of its density.
  PlanKnowledge Knowledge() const;
};

// Estimates the surface by Gaussian-process regression. inspection.uncertainty states the prior and
// must be set; its mean is the model. A prior far wider than the deviations leaves them as they
// are. Errors of SampleTargets.
absl::StatusOr<MeasuredSurface> EstimateSurface(const TriangleMesh& model,
                                                const Inspection& inspection,
                                                const MeasuredPart& part, int threads = 0);

}  // namespace sightline
