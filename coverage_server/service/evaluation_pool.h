// SPDX-License-Identifier: Apache-2.0
// A fixed pool of threads on which all queries run.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <list>
#include <mutex>
#include <thread>
#include <vector>

#include "absl/status/status.h"

namespace sightline {

// Queries keep scratch memory and GL contexts per thread, but gRPC makes and ends threads with its
// calls; so queries run here. Batches share the threads in turn, chunk by chunk, so that a batch of
// slow exact queries does not block fast ones.
class EvaluationPool {
 public:
  // Work on items [begin, end); stops early when `cancelled` becomes true.
  using Body = std::function<void(size_t begin, size_t end, const std::atomic<bool>& cancelled)>;

  // `threads` >= 1; at most `max_batches` may be waiting or running at a time.
  EvaluationPool(int threads, size_t max_batches);
  ~EvaluationPool();
  EvaluationPool(const EvaluationPool&) = delete;
  EvaluationPool& operator=(const EvaluationPool&) = delete;

  // Runs `body` over [0, items) in chunks of at most `chunk` and waits for the end. Meanwhile calls
  // `check_stop` every 10 ms on the calling thread; its first error cancels the rest and is
  // returned. UNAVAILABLE (reason OVERLOADED) when too many batches wait; INTERNAL when `body`
  // throws (RESOURCE_EXHAUSTED for lack of memory).
  absl::Status Run(size_t items, size_t chunk, const std::function<absl::Status()>& check_stop,
                   const Body& body);

  int threads() const { return static_cast<int>(threads_.size()); }

 private:
  struct Batch {
    size_t items = 0;
    size_t chunk = 1;
    const Body* body = nullptr;
    size_t next = 0;
    int running = 0;
    std::atomic<bool> cancelled = false;
    absl::Status error;
    std::condition_variable done;

    bool finished() const { return next >= items && running == 0; }
  };

  void Work();
  Batch* NextBatch();

  const size_t max_batches_;
  std::mutex mutex_;
  std::condition_variable work_;
  std::list<Batch*> batches_;  // front: next to be served
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace sightline
