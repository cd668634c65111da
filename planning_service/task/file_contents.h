// SPDX-License-Identifier: Apache-2.0
// Checks the content of the files of a task against the task: length units, and other files that
// they need. A task with such an error is refused when it is submitted, not minutes later when its
// job runs.
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

// Checks the files of parts, obstacles and tolerances. `files`: names of all files that came with
// the task. INVALID_ARGUMENT with the violated field, such as "inspection.part.unit": an empty
// file; content that is not STEP; a STEP file without a length unit while the task states none
// (core/text/step_length_unit.h), or with a unit while the task states one; the same for a QIF
// file, and content that cannot be read. NOT_FOUND, reason FILE_UNKNOWN: a buffer of a .gltf file
// that is neither embedded nor among `files`. The job itself checks STEP and glTF files of more
// than 64 MiB, QIF files of more than 4 MiB, and damaged STEP files. Also returns errors of
// `read`.
absl::Status CheckFileContents(const v1::PlanningTask& task, const std::vector<std::string>& files,
                               const TaskFilePieces& read);

}  // namespace sightline
