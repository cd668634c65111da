// SPDX-License-Identifier: Apache-2.0
// Runs queued jobs, each in its own processes and in its own folder.
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
  // Folder in which jobs keep meshes of STEP files, on each machine that runs jobs; empty: the
  // user's cache.
  std::string step_cache_folder;
  // Absolute paths of further folders that messages to clients must not name (server_paths.h). The
  // folders of the jobs, of the STEP cache and of the program need not be listed.
  std::vector<std::string> hidden_folders;
  int workers = 1;                                     // jobs at a time; 0: others run them
  int parts = 1;                                       // most shards of a job that can be split
  int64_t max_memory_bytes = 0;                        // of each of its commands; 0: no limit
  absl::Duration max_time = absl::InfiniteDuration();  // of each of an attempt's commands
};

// If an attempt ends without a stated reason (killed, crashed, its server gone), its job returns to
// the queue and later resumes from its checkpoint. After several such ends in a row without
// progress (more if killed from outside than if crashed) the job fails, reason PROCESS_ENDED. While
// the disk is full no job starts, and a job that fails is tried again. A job counts as done only
// once all its results are stored. Messages to clients hold no paths of this machine.
class JobRunner {
 public:
  // Pointers must outlive it.
  JobRunner(JobRunnerOptions options, PlanningJobStore* store, ArtefactStore* artefacts,
            ClientAccess* access, ComputeEngine* engine);
  // Stops.
  ~JobRunner();

  void Start();
  // Ends the processes on this machine and puts their jobs back into the queue; the next start
  // resumes them. Commands on a cluster run on.
  void Stop();

 private:
  void Work();
  // Waits for that time; returns false at once if the runner stops.
  bool Pause(absl::Duration time);
  void Run(const PlanningJob& job);
  // Puts the files of the task into the job's folder.
  absl::Status Prepare(const PlanningJob& job, const std::string& folder);
  void Conclude(const PlanningJob& job, const JobProcessEnd& end, bool advanced,
                const std::string& folder);
  absl::StatusOr<std::vector<JobFile>> StoreResults(const std::string& folder);
  // Repeats `tell` until the store answers, however long it is down; gives up when stopping.
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
