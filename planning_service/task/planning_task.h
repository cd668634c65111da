// SPDX-License-Identifier: Apache-2.0
// Interpretation of a planning task: whether it can be answered, which files it needs, and the
// command that answers it.
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

// Whether a name may stand for a file of a job: a relative path with '/' of at most 200 bytes
// without "..", ".", empty parts, backslashes or control characters, and none of the names that
// the service itself writes beside the files (inspection.json, recordings.json, plan.json).
// INVALID_ARGUMENT says what is wrong.
absl::Status CheckFileName(const std::string& name);

// Names of files in the task's messages without steps "." ("./part.stl" is "part.stl"), as the
// files themselves are named.
void NormaliseFileNames(v1::PlanningTask* task);

// Bytes of a file that came with the task. NOT_FOUND: there is none of that name.
using TaskFileReader = std::function<absl::StatusOr<std::string>(const std::string& name)>;

// Checks kind, fields and values of a task, and that every file it names is among `files`: also the
// files that its material files name. No other file can be read when the task is worked on, since
// each name is one of `files`. INVALID_ARGUMENT with field violations
// ("inspection.camera.rows_px"); NOT_FOUND, reason FILE_UNKNOWN, for a file that did not come.
absl::Status CheckTask(const v1::PlanningTask& task, const std::vector<std::string>& files,
                       const TaskFileReader& read);

// SHA-256 of task, names and digests: equal for equal questions.
std::string TaskFingerprint(const v1::PlanningTask& task, const std::vector<JobFile>& files);

// Writes the messages of the task (inspection.json, recordings.json, plan.json) into `folder`,
// where its files are already.
absl::Status WriteTaskFiles(const v1::PlanningTask& task, const std::string& folder);

// Command lines of the `sightline` program that answer a task.
struct TaskCommands {
  // Do not depend on each other: may run in any order, at the same time, on several machines, and
  // again. Empty: the task does not split.
  std::vector<std::vector<std::string>> parts;
  // Runs once all shards have ended well, and makes the results: the same bytes for any number of
  // shards.
  std::vector<std::string> conclusion;
};

// Commands, run in that folder, with results in `out_folder`. Checkpoints are kept in
// `checkpoint_folder`. There are at most `most_parts` parts, and none where
// they would be a single one.
TaskCommands SplitTask(const v1::PlanningTask& task, const std::string& out_folder,
                       const std::string& checkpoint_folder, int most_parts);

}  // namespace sightline
