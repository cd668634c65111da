// SPDX-License-Identifier: Apache-2.0
// Commands of jobs as arrays of a cluster's workload manager.
#pragma once

#include <memory>

#include "absl/time/time.h"
#include "planning_service/execution/engine/batch_scheduler.h"
#include "planning_service/execution/engine/compute_engine.h"

namespace sightline {

struct ClusterTiming {
  absl::Duration files = absl::Milliseconds(500);  // between looks at the commands' messages
  absl::Duration scheduler = absl::Seconds(3);     // between questions to the workload manager
  // How long the exit code of a command that the workload manager says has ended may take to be
  // seen here.
  absl::Duration grace = absl::Seconds(15);
  // How long commands that were cancelled may take to be gone.
  absl::Duration stop = absl::Seconds(60);
};

// An attempt that is left runs on, and is found again by the record in its folder, also after the
// service was killed. A command whose machine is lost has ended without a word.
std::unique_ptr<ComputeEngine> MakeClusterEngine(std::unique_ptr<BatchScheduler> scheduler,
                                                 ClusterTiming timing = {});

}  // namespace sightline
