// SPDX-License-Identifier: Apache-2.0
// Errors that scans of a plan share because they are made from one place of the sensors or in one
// set-up.
#pragma once

#include <span>
#include <string>

#include "core/inspection/inspection.h"
#include "core/shared_errors/shared_errors.h"
#include "planning/requirements/known_targets.h"
#include "planning/requirements/requirements.h"

namespace sightline {

// True if estimates of different targets share errors at all.
bool HasSharedErrors(const Inspection& inspection);

// Shared errors of the scans of `knowledge.density`, in the order of execution. Camera and laser in
// one housing, or held by one robot, have one calibration for all scans; otherwise they have one
// for each place. Scans of one set-up have one frame: turns of the table count as exact. A robot
// approaches every scan anew. `method`: registration of the inspection, or kNone for scans
// registered otherwise. The targets of `knowledge` must outlive the result.
SharedErrors SharedErrorsOf(const Inspection& inspection, const Requirements& requirements,
                            std::span<const Measurement> scans,
                            const Eigen::Vector3d& part_centre_m, const PlanKnowledge& knowledge,
                            RegistrationMethod method);

// One or two sentences: how the frames of the scans are joined, and how well.
std::string RegistrationStatement(const Inspection& inspection, const SharedErrors& errors);
// One sentence: which errors of the calibration are assumed.
std::string CalibrationStatement(const Inspection& inspection);

}  // namespace sightline
