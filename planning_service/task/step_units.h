// SPDX-License-Identifier: Apache-2.0
// Units of STEP files that come with a task. A file that states none is refused when the task is
// submitted, not minutes later when its job runs.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "sightline/v1/planning_task.pb.h"

namespace sightline {

// Calls `take` with the bytes of a file of the task, piece by piece, until it returns false.
// NOT_FOUND: no file of that name.
using TaskFilePieces = std::function<absl::Status(
    const std::string& name, const std::function<bool(std::string_view)>& take)>;

// Checks the STEP files of parts, obstacles and tolerances for which the task states no unit.
// INVALID_ARGUMENT with the violated field, such as "inspection.part.unit", for a file that has no
// length unit (core/text/step_length_unit.h). A file of more than 64 MiB, and one of which a pass
// over its text cannot tell, is left to the importer. Errors also as of `read`.
absl::Status CheckStepUnits(const v1::PlanningTask& task, const TaskFilePieces& read);

}  // namespace sightline
