// SPDX-License-Identifier: Apache-2.0
// Whether a plan can prove that each toleranced feature conforms.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/conformance/conformance.h"
#include "core/inspection/inspection.h"
#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"
#include "planner_client/requirements/requirements.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// What a plan of scans tells of the targets of one sampling.
struct PlanKnowledge {
  const TargetSet* targets;
  const TargetBits* measurable;
  std::vector<SurfaceUncertainty> uncertainty;  // exact, of every target after all scans
  std::vector<int32_t> points;                  // that told of every target
  // Of every scan, equivalent information density of every target; needed with calibration errors.
  std::vector<std::vector<float>> density;
};

// One verdict per feature, in their order (core/conformance). The geometry that is fitted, plane or
// cylinder, is found from the feature's targets; where neither fits and the tolerance asks for more
// than deviations, or where a feature holds too few targets, the verdict says so. `scans` are those
// of `knowledge.density`, `part_centre_m` the centre of the part's bounding box.
absl::StatusOr<std::vector<v1::FeatureVerdict>> JudgeFeatures(const Inspection& inspection,
                                                              const Requirements& requirements,
                                                              std::span<const Measurement> scans,
                                                              const Eigen::Vector3d& part_centre_m,
                                                              const PlanKnowledge& knowledge);

}  // namespace sightline
