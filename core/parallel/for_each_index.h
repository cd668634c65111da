// SPDX-License-Identifier: Apache-2.0
// The same work for every index, on several threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/parallel/worker_threads.h"

namespace sightline {

// Calls work(index) -> absl::Status once for every index below `count`, on as many threads as there
// are processors. `work` must not access data of another index. Returns the error of the lowest
// index that failed; after an error no further index is begun. Passes exceptions of `work` on.
template <typename Work>
absl::Status ForEachIndex(size_t count, const Work& work) {
  std::vector<absl::Status> statuses(count);
  std::atomic<size_t> next = 0;
  std::atomic<bool> failed = false;
  const size_t processors = std::max(1u, std::thread::hardware_concurrency());
  WorkerThreads threads;
  for (size_t thread = 0; thread < std::min(processors, count); ++thread) {
    threads.Start([&] {
      for (size_t i = next++; i < count && !failed; i = next++) {
        statuses[i] = work(i);
        if (!statuses[i].ok()) failed = true;
      }
    });
  }
  threads.Join();
  for (absl::Status& status : statuses) {
    if (!status.ok()) return std::move(status);
  }
  return absl::OkStatus();
}

}  // namespace sightline
