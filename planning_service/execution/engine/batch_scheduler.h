// SPDX-License-Identifier: Apache-2.0
// An array of tasks on a cluster, as its workload manager sees it.
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
  // Id of an array whose elements must all have ended well before this one begins; empty: none.
  std::string after;
  int64_t max_memory_bytes = 0;                        // of an element; 0: the cluster's default
  absl::Duration max_time = absl::InfiniteDuration();  // of an element, from its start
};

struct ElementStatus {
  enum class State {
    kWaiting,
    kRunning,
    kEnded,  // well or not
    kLost,   // its machine went, or it had to make room
    kOutOfMemory,
    kOutOfTime,
    kCancelled,  // by somebody
  };
  State state = State::kWaiting;
  std::string reason;  // the workload manager's word for people; may be empty
};

// Errors of all methods: UNAVAILABLE: it does not answer, or cannot take this now; else it refused:
// the message is its own.
class BatchScheduler {
 public:
  virtual ~BatchScheduler() = default;

  // "slurm", "kubernetes".
  virtual std::string kind() const = 0;
  // Whether it can be used from here.
  virtual absl::Status Check() = 0;
  // Returns the array's id.
  virtual absl::StatusOr<std::string> Submit(const TaskArray& array) = 0;
  // Lets an array begin whose `after` has ended well, where the workload manager does not see to
  // that itself.
  virtual absl::Status Release(const std::string& id) = 0;
  // Status of elements 1 to `size`. Empty: it knows of none such, or no longer.
  virtual absl::StatusOr<std::vector<std::optional<ElementStatus>>> Look(const std::string& id,
                                                                         int size) = 0;
  // Does nothing to finished arrays and unknown ids.
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
