// SPDX-License-Identifier: Apache-2.0
// Checks the content of the files that come with a task against the task: units of length, files
// that they need beside them. Errors found here are refused when the task is submitted, not minutes
// later when its job runs.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "sightline/v1/planning_task.pb.h"

namespace sightline {

// Calls `take` with the bytes of a file of the task, piece by piece, until it returns false.
// NOT_FOUND: no file of that name.
using TaskFilePieces = std::function<absl::Status(
    const std::string& name, const std::function<bool(std::string_view)>& take)>;

// Checks the files of parts, obstacles and tolerances. `files`: names of all that came with the
// task. INVALID_ARGUMENT with the violated field, such as "inspection.part.unit": a file that is
// empty; a STEP file that is none, that has no length unit while the task states none
// (core/text/step_length_unit.h), or that has one while the task states another; the same of a QIF
// file, and content that cannot be read. NOT_FOUND, reason FILE_UNKNOWN: a buffer of a
// .gltf file that is neither embedded nor among `files`. A STEP or glTF file of more than 64 MiB, a
// QIF file of more than 4 MiB, and a damaged STEP file are left to the job. Errors also as of
// `read`.
absl::Status CheckFileContents(const v1::PlanningTask& task, const std::vector<std::string>& files,
                               const TaskFilePieces& read);

}  // namespace sightline
