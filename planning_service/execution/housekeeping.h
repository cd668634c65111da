// SPDX-License-Identifier: Apache-2.0
// Periodic work of the planning service: service time, orphaned jobs, retention.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "absl/time/time.h"
#include "planning_service/artefact_store/artefact_store.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

struct HousekeepingOptions {
  absl::Duration keep_finished = absl::Hours(24 * 30);  // of service time
  std::string work_folder;
  absl::Duration interval = absl::Seconds(5);
  absl::Duration removal_interval = absl::Minutes(10);
};

class Housekeeping {
 public:
  // Starts at once, in a thread of its own. The pointers' targets must outlive it.
  Housekeeping(HousekeepingOptions options, PlanningJobStore* store, ArtefactStore* artefacts);
  ~Housekeeping();

  // Removes old jobs and uploads, files that nothing names, and folders of finished or unknown
  // jobs; once.
  absl::Status RemoveOld();

 private:
  void Work();

  const HousekeepingOptions options_;
  PlanningJobStore* const store_;
  ArtefactStore* const artefacts_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace sightline
