// SPDX-License-Identifier: Apache-2.0
// Messages between the service and the commands of a job on other machines: files in a folder
// that all of them see.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planning_service/execution/command_messages.h"
#include "planning_service/execution/engine/compute_engine.h"

namespace sightline {

// Mean progress of parts, most of the whole, with that of the conclusion.
JobProgress ProgressOfParts(const std::vector<JobProgress>& parts, const JobProgress& conclusion);

// Calls `prepare` of the attempt; how it ended, if that failed.
std::optional<JobProcessEnd> PrepareFailure(const AttemptOptions& options);

// Record of the arrays that work on a job's folder: kept there as long as they are to.
struct ClusterRecord {
  std::string scheduler;  // BatchScheduler::kind
  std::string tasks;      // absolute path of the tasks' folder
  int part_count = 0;
  std::string parts;  // ids; empty: not submitted (yet)
  std::string conclusion;

  // Empty: there is none that can be read.
  static std::optional<ClusterRecord> Read(const std::string& folder);
  absl::Status Write(const std::string& folder) const;
  // Whether all that it needs was submitted.
  bool IsComplete() const { return !conclusion.empty() && (part_count == 0 || !parts.empty()); }
};

// Makes a new folder of scripts, `parts-K.sh` and `conclusion-1.sh`, in the job's folder. Each runs
// its command, keeps its messages in NAME.stderr and its exit code in NAME.exit, and ends it when
// the tasks are revoked. Returns the folder.
absl::StatusOr<std::string> MakeTaskFolder(const AttemptOptions& options);

// Tasks that still run in the job's folder, perhaps on an unreachable machine, end within seconds
// of seeing it. Returns whether there may be any.
bool RevokeTasks(const std::string& folder);
// Waits these seconds, while it is wished.
void AwaitRevokedTasks(const ProgressCallback& wish);

// One command's files.
class TaskFiles {
 public:
  // `name`: as of MakeTaskFolder, e.g. "parts-1".
  TaskFiles(const std::string& folder, const std::string& name);
  // Reads new messages.
  void Read();

  const CommandMessages& messages() const { return messages_; }
  // Known once all its messages are.
  std::optional<int> exit_code() const { return caught_up_ ? exit_code_ : std::nullopt; }

 private:
  const std::string path_;
  size_t read_ = 0;
  bool caught_up_ = false;
  CommandMessages messages_;
  std::optional<int> exit_code_;
};

}  // namespace sightline
