// SPDX-License-Identifier: Apache-2.0
// Messages between the service and the commands of a job on other machines, as files in a shared
// folder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planning_service/execution/command_messages.h"
#include "planning_service/execution/engine/compute_engine.h"

namespace sightline {

// Progress of the job: 0.95 times the mean progress of the shards plus 0.05 times the conclusion's.
JobProgress ProgressOfParts(const std::vector<JobProgress>& parts, const JobProgress& conclusion);

// Calls `prepare` of the attempt. Returns the failed end of the job if `prepare` fails.
std::optional<JobProcessEnd> PrepareFailure(const AttemptOptions& options);

// Record of the arrays that work on a job's folder; kept in the folder until they are revoked.
struct ClusterRecord {
  std::string scheduler;  // BatchScheduler::kind
  std::string tasks;      // absolute path of the tasks' folder
  int part_count = 0;
  std::string parts;  // ids; empty: not submitted (yet)
  std::string conclusion;

  // Empty: the folder has no readable record.
  static std::optional<ClusterRecord> Read(const std::string& folder);
  absl::Status Write(const std::string& folder) const;
  // True if all arrays of the attempt were submitted.
  bool IsComplete() const { return !conclusion.empty() && (part_count == 0 || !parts.empty()); }
};

// Makes a new folder of scripts, `parts-K.sh` and `conclusion-1.sh`, in the job's folder, and
// returns its path. A script runs its command, writes messages to NAME.stderr and the exit code to
// NAME.exit, and kills the command when the tasks are revoked.
absl::StatusOr<std::string> MakeTaskFolder(const AttemptOptions& options);

// Revokes tasks that still run in the job's folder, perhaps on an unreachable machine: each ends
// within seconds of seeing the revocation. Returns true if there may be such tasks.
bool RevokeTasks(const std::string& folder);
// Waits until revoked tasks have ended; returns early unless `wish` is Wish::kGoOn.
void AwaitRevokedTasks(const ProgressCallback& wish);

// One command's files.
class TaskFiles {
 public:
  // `name`: name of the script without ".sh" (MakeTaskFolder), e.g. "parts-1".
  TaskFiles(const std::string& folder, const std::string& name);
  // Reads new messages.
  void Read();

  const CommandMessages& messages() const { return messages_; }
  // Set once the command has ended and all its messages have been read.
  std::optional<int> exit_code() const { return caught_up_ ? exit_code_ : std::nullopt; }

 private:
  const std::string path_;
  size_t read_ = 0;
  bool caught_up_ = false;
  CommandMessages messages_;
  std::optional<int> exit_code_;
};

}  // namespace sightline
