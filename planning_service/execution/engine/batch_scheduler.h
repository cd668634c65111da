// SPDX-License-Identifier: Apache-2.0
// Interface to the workload manager of a cluster: arrays of tasks, submitted, queried, cancelled.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

// Longest run of a command of the workload manager, such as squeue or kubectl.
inline constexpr absl::Duration kSchedulerToolTimeout = absl::Seconds(30);

struct TaskArray {
  std::string job;     // owner of the array; letters, digits and '-'
  std::string script;  // element K, from 1, runs `/bin/sh SCRIPT-K.sh`
  int size = 1;
  std::string folder;  // working folder
  // Id of an array all of whose elements must succeed before this array begins; empty: none.
  std::string after;
  int64_t max_memory_bytes = 0;                        // of an element; 0: the cluster's default
  absl::Duration max_time = absl::InfiniteDuration();  // of an element, from its start
};

struct ElementStatus {
  enum class State {
    kWaiting,
    kRunning,
    kEnded,  // with success or not
    kLost,   // its machine failed, or it was preempted
    kOutOfMemory,
    kOutOfTime,
    kCancelled,  // by a user or an administrator
  };
  State state = State::kWaiting;
  std::string reason;  // for people, from the workload manager; may be empty
};

// Errors of all methods: UNAVAILABLE: the workload manager does not answer or cannot accept the
// request now. Any other code: it has refused the request; the message is its own.
class BatchScheduler {
 public:
  virtual ~BatchScheduler() = default;

  // "slurm", "kubernetes".
  virtual std::string kind() const = 0;
  // OK if the workload manager can be used from this machine.
  virtual absl::Status Check() = 0;
  // Returns the array's id.
  virtual absl::StatusOr<std::string> Submit(const TaskArray& array) = 0;
  // Starts an array whose `after` has succeeded, if the workload manager does not do that itself.
  // Called once the service has seen that success.
  virtual absl::Status Release(const std::string& id) = 0;
  // Status of elements 1 to `size`; nullopt for an element that the workload manager does not know.
  virtual absl::StatusOr<std::vector<std::optional<ElementStatus>>> Look(const std::string& id,
                                                                         int size) = 0;
  // Cancels an array. Has no effect on finished arrays and unknown ids.
  virtual absl::Status Cancel(const std::string& id) = 0;
  // Cancels all arrays of a job.
  virtual absl::Status CancelJob(const std::string& job) = 0;
};

struct SlurmOptions {
  std::string partition;       // empty: the cluster's default
  std::string account;         // empty: the user's default
  int cpus = 0;                // of an element; 0: the cluster's default
  std::string command_folder;  // of sbatch, squeue and scancel; empty: those of PATH
};
std::unique_ptr<BatchScheduler> MakeSlurmScheduler(SlurmOptions options);

struct KubernetesOptions {
  std::string name_space = "default";
  std::string image;           // has the programs where the service has them
  std::string volume_claim;    // of the volume that holds the service's data folder
  std::string mount_path;      // absolute path of the volume, the same as in the service
  int cpus = 0;                // of an element; 0: the namespace's default
  std::string command_folder;  // of kubectl; empty: that of PATH
};
std::unique_ptr<BatchScheduler> MakeKubernetesScheduler(KubernetesOptions options);

}  // namespace sightline
