// SPDX-License-Identifier: Apache-2.0
// Runs the commands of jobs as arrays of a cluster's workload manager.
#pragma once

#include <memory>

#include "absl/time/time.h"
#include "planning_service/execution/engine/batch_scheduler.h"
#include "planning_service/execution/engine/compute_engine.h"

namespace sightline {

struct ClusterTiming {
  absl::Duration files = absl::Milliseconds(500);  // between reads of the commands' messages
  absl::Duration scheduler = absl::Seconds(3);     // between queries of the workload manager
  // After the workload manager reports the end of a command: longest time until the command's exit
  // code shows in the shared folder.
  absl::Duration grace = absl::Seconds(15);
  // Longest time until cancelled commands have ended.
  absl::Duration stop = absl::Seconds(60);
};

// An attempt that its caller leaves (Wish::kLeave) runs on. A later Run finds it by the record in
// its folder, even if the service was killed. A lost machine ends its command as kWithoutWord.
std::unique_ptr<ComputeEngine> MakeClusterEngine(std::unique_ptr<BatchScheduler> scheduler,
                                                 ClusterTiming timing = {});

}  // namespace sightline
