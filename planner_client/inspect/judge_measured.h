// SPDX-License-Identifier: Apache-2.0
// Verdicts on toleranced features from measured points (ISO 14253-1): value, expanded uncertainty,
// decision and the reason for it.
//
//   auto surface = EstimateSurface(mesh, inspection, part);
//   JudgedInspection judged = JudgeMeasured(inspection, requirements, part, scans, *surface);
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "planner_client/inspect/measured_surface.h"
#include "planner_client/replanning/measured_part.h"
#include "planning/requirements/requirements.h"
#include "sightline/v1/measured_result.pb.h"

namespace sightline {

// Uncertainty to which a target of a feature has to be known.
struct NeededUncertainty {
  Eigen::Vector3f position_m;  // CAD coordinates
  float uncertainty_m = 0;     // 0: it is known well enough
};

struct JudgedInspection {
  // Without version and next_scan.
  v1::InspectionResult result;
  // For every feature of the requirements, the uncertainties at its targets with which it may be
  // decided; empty if it is decided or cannot be evaluated. With s the width of the zone and g the
  // guard factor:
  // - a target that is not known well enough: the uncertainty with which a good part is accepted
  //   as often as not (ProvableUncertainty);
  // - a known target of a profile with the deviation d: |s/2 - |d|| / g, with which its guard band
  //   ends where its deviation is now, but not less than half of the present uncertainty; 0 if it
  //   has this uncertainty already;
  // - a known target of another feature, or of a profile that no single target holds back: half of
  //   the median of the feature's known targets.
  std::vector<std::vector<NeededUncertainty>> needed;
};

// `inspection` is that of the model; its uncertainty must be set. `scans` are those of the plan
// that the part's files refer to. Values refer to the nominal surfaces of faces, not to the facets
// that stand for them. Where the drawing states no datum the registered model is the datum, and the
// covariance of its pose counts.
JudgedInspection JudgeMeasured(const Inspection& inspection, const Requirements& requirements,
                               const MeasuredPart& part, std::span<const Measurement> scans,
                               const MeasuredSurface& surface);

}  // namespace sightline
