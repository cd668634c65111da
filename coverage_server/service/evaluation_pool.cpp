// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/evaluation_pool.h"

#include <algorithm>
#include <cassert>
#include <chrono>

#include "absl/strings/str_cat.h"
#include "core/parallel/exception_status.h"
#include "proto/status/rpc_status.h"

namespace sightline {

EvaluationPool::EvaluationPool(int threads, size_t max_batches) : max_batches_(max_batches) {
  assert(threads >= 1);
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Work(); });
}

EvaluationPool::~EvaluationPool() {
  {
    std::lock_guard lock(mutex_);
    assert(batches_.empty());
    stopping_ = true;
  }
  work_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

absl::Status EvaluationPool::Run(size_t items, size_t chunk,
                                 const std::function<absl::Status()>& check_stop,
                                 const Body& body) {
  assert(chunk >= 1);
  if (items == 0) return absl::OkStatus();
  Batch batch;
  batch.items = items;
  batch.chunk = chunk;
  batch.body = &body;
  std::unique_lock lock(mutex_);
  if (batches_.size() >= max_batches_) {
    return WithRetryDelay(
        WithErrorInfo(absl::UnavailableError(absl::StrCat("overloaded: ", batches_.size(),
                                                          " batches are waiting already")),
                      "OVERLOADED"),
        absl::Milliseconds(200));
  }
  const auto place = batches_.insert(batches_.end(), &batch);
  if (items > chunk) {
    work_.notify_all();
  } else {
    work_.notify_one();
  }
  absl::Status stopped;
  while (!batch.done.wait_for(lock, std::chrono::milliseconds(10),
                              [&batch] { return batch.finished(); })) {
    if (!stopped.ok()) continue;
    lock.unlock();
    stopped = check_stop();
    lock.lock();
    if (!stopped.ok()) {
      batch.cancelled = true;
      batch.next = batch.items;
    }
  }
  batches_.erase(place);
  return stopped.ok() ? batch.error : stopped;
}

EvaluationPool::Batch* EvaluationPool::NextBatch() {
  for (auto it = batches_.begin(); it != batches_.end(); ++it) {
    if ((*it)->next < (*it)->items) {
      Batch* batch = *it;
      batches_.splice(batches_.end(), batches_, it);
      return batch;
    }
  }
  return nullptr;
}

void EvaluationPool::Work() {
  std::unique_lock lock(mutex_);
  while (true) {
    Batch* batch = nullptr;
    work_.wait(lock, [&] { return stopping_ || (batch = NextBatch()) != nullptr; });
    if (batch == nullptr) return;
    const size_t begin = batch->next;
    const size_t end = std::min(batch->items, begin + batch->chunk);
    batch->next = end;
    ++batch->running;
    lock.unlock();
    absl::Status error;
    try {
      (*batch->body)(begin, end, batch->cancelled);
    } catch (...) {
      error = StatusOfException();
    }
    lock.lock();
    --batch->running;
    if (!error.ok()) {
      batch->error = error;
      batch->cancelled = true;
      batch->next = batch->items;
    }
    if (batch->finished()) batch->done.notify_one();
  }
}

}  // namespace sightline
