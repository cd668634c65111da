// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/tiles.h"

#include <algorithm>
#include <atomic>
#include <mutex>

#include "core/parallel/worker_threads.h"

namespace sightline {

absl::Status ForEachTile(int count, int threads, const TransportProgress& progress, double from,
                         double to, const std::function<void(int)>& work) {
  std::atomic<int> next = 0;
  std::mutex mutex;
  int done = 0;  // guarded by mutex
  const auto cancelled = [&] {
    return progress.cancelled != nullptr && progress.cancelled->load(std::memory_order_relaxed);
  };
  const auto run = [&] {
    while (!cancelled()) {
      const int i = next.fetch_add(1, std::memory_order_relaxed);
      if (i >= count) return;
      work(i);
      const std::lock_guard lock(mutex);
      ++done;
      if (progress.report) progress.report(from + (to - from) * done / count);
    }
  };
  {
    WorkerThreads helpers;
    for (int t = 1; t < std::min(threads, count); ++t) helpers.Start(run);
    run();
    helpers.Join();
  }
  return cancelled() ? absl::CancelledError("light transport was cancelled") : absl::OkStatus();
}

}  // namespace sightline
