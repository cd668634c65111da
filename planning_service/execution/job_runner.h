// SPDX-License-Identifier: Apache-2.0
// Runs queued jobs, each in processes and a folder of its own.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "planning_service/access/client_access.h"
#include "planning_service/artefact_store/artefact_store.h"
#include "planning_service/execution/engine/compute_engine.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

struct JobRunnerOptions {
  std::string program;      // path of `sightline`
  std::string work_folder;  // jobs have their folders in it; they stay over restarts until done
  // Folder in which jobs keep meshes of STEP files, on every machine that runs them; empty: the
  // cache of the user.
  std::string step_cache_folder;
  // Absolute paths of further folders that messages to clients must not name (server_paths.h);
  // those of the jobs, of the STEP cache and of the program are known.
  std::vector<std::string> hidden_folders;
  int workers = 1;                                     // jobs at a time; 0: others run them
  int parts = 1;                                       // into how many a job is split that can be
  int64_t max_memory_bytes = 0;                        // of each of its commands; 0: no limit
  absl::Duration max_time = absl::InfiniteDuration();  // of each of an attempt's commands
};

// An attempt that ends without a word (killed, crashed, its server gone) puts its job back into the
// queue, and the job goes on from its checkpoint. After several such ends in a row without progress
// (more if killed from outside than if crashed) the job fails, reason PROCESS_ENDED. Nothing is
// started while the disk is full, and a job that fails then is tried again. Results are stored
// complete before the job counts as done. Messages to clients hold no paths of this machine.
class JobRunner {
 public:
  // Pointers must outlive it.
  JobRunner(JobRunnerOptions options, PlanningJobStore* store, ArtefactStore* artefacts,
            ClientAccess* access, ComputeEngine* engine);
  // Stops.
  ~JobRunner();

  void Start();
  // Ends the processes, unless they run elsewhere, and puts their jobs back into the queue: the
  // next start goes on with them.
  void Stop();

 private:
  void Work();
  // Waits; false when it is to stop.
  bool Pause(absl::Duration time);
  void Run(const PlanningJob& job);
  // Puts the files of the task into the job's folder.
  absl::Status Prepare(const PlanningJob& job, const std::string& folder);
  void Conclude(const PlanningJob& job, const JobProcessEnd& end, bool advanced,
                const std::string& folder);
  absl::StatusOr<std::vector<JobFile>> StoreResults(const std::string& folder);
  // Retries until the store has it, however long the database does not answer; not when stopping.
  void Tell(const std::string& what, const std::function<absl::Status()>& tell);

  const JobRunnerOptions options_;
  PlanningJobStore* const store_;
  ArtefactStore* const artefacts_;
  ClientAccess* const access_;
  ComputeEngine* const engine_;
  std::vector<std::thread> threads_;
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;
  std::condition_variable stop_;
};

}  // namespace sightline
