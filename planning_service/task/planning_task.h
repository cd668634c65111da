// SPDX-License-Identifier: Apache-2.0
// Interprets a planning task: checks it, finds the files that it needs, and makes the commands that
// carry it out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planning_service/job_store/planning_job.h"
#include "sightline/v1/planning_task.pb.h"

namespace sightline {

// "plan", "evaluate", "inspect", "accept", "optics", "render", "verify", "diagnose".
const std::vector<std::string>& TaskKinds();

// Checks the name of a file of a job: a relative path with '/' of at most 200 bytes without "..",
// ".", empty parts, backslashes or control characters. The names of files that the service writes
// itself (inspection.json, recordings.json, plan.json) are refused. INVALID_ARGUMENT states the
// reason.
absl::Status CheckFileName(const std::string& name);

// Removes steps "." from the file names in the task's messages ("./part.stl" becomes "part.stl"),
// so that they match the names of the files.
void NormaliseFileNames(v1::PlanningTask* task);

// Returns the bytes of a file that came with the task. NOT_FOUND: no file has that name.
using TaskFileReader = std::function<absl::StatusOr<std::string>(const std::string& name)>;

// Checks kind, fields and values of a task. Also checks that every file it names is among `files`,
// including files that its material files name, so that the job can read no other file.
// INVALID_ARGUMENT with field violations ("inspection.camera.rows_px"); NOT_FOUND, reason
// FILE_UNKNOWN: a named file is missing.
absl::Status CheckTask(const v1::PlanningTask& task, const std::vector<std::string>& files,
                       const TaskFileReader& read);

// SHA-256 of the task and of the names and digests of its files.
std::string TaskFingerprint(const v1::PlanningTask& task, const std::vector<JobFile>& files);

// Writes the messages of the task (inspection.json, recordings.json, plan.json) into `folder`,
// where its files are already.
absl::Status WriteTaskFiles(const v1::PlanningTask& task, const std::string& folder);

// Command lines of the `sightline` program that carry out a task.
struct TaskCommands {
  // Shards. They are independent: they may run in any order, at the same time, on several machines,
  // and repeatedly. Empty: the task is not split.
  std::vector<std::vector<std::string>> parts;
  // Runs once all shards have succeeded, and makes the results. The bytes of the results do not
  // depend on the number of shards.
  std::vector<std::string> conclusion;
};

// Commands that run in the folder of the task's files and write results to `out_folder` and
// checkpoints to `checkpoint_folder`. There are at most `most_parts` shards, and none if there
// would be only one.
TaskCommands SplitTask(const v1::PlanningTask& task, const std::string& out_folder,
                       const std::string& checkpoint_folder, int most_parts);

}  // namespace sightline
