// SPDX-License-Identifier: Apache-2.0
// Threads of one piece of work; an exception in one of them reaches the waiting thread.
#pragma once

#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace sightline {

// An exception that leaves a std::thread ends the process. Work that runs out of memory must only
// fail itself.
class WorkerThreads {
 public:
  WorkerThreads() = default;
  ~WorkerThreads() { Wait(); }
  WorkerThreads(const WorkerThreads&) = delete;
  WorkerThreads& operator=(const WorkerThreads&) = delete;

  // Throws if the system gives no more threads; those that run go on.
  template <typename Work>
  void Start(Work work) {
    threads_.emplace_back([this, work = std::move(work)]() mutable {
      try {
        work();
      } catch (...) {
        const std::lock_guard lock(mutex_);
        if (!error_) error_ = std::current_exception();
      }
    });
  }

  // Waits for all and throws the first exception of theirs.
  void Join() {
    Wait();
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  void Wait() {
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::exception_ptr error_;
};

}  // namespace sightline
