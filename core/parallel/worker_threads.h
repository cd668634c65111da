// SPDX-License-Identifier: Apache-2.0
// Threads of one task; an exception in one of them is thrown again in the waiting thread.
#pragma once

#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace sightline {

// An exception that leaves a std::thread ends the process, but a task that runs out of memory must
// only fail itself.
class WorkerThreads {
 public:
  WorkerThreads() = default;
  ~WorkerThreads() { Wait(); }
  WorkerThreads(const WorkerThreads&) = delete;
  WorkerThreads& operator=(const WorkerThreads&) = delete;

  // Throws if no more threads are available; running threads continue.
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

  // Waits for all threads and throws the first of their exceptions.
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
