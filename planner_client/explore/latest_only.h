// SPDX-License-Identifier: Apache-2.0
// Long work of which only the latest request matters: a new request cancels the one before.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <utility>

namespace sightline {

// Thread-safe.
class LatestOnly {
 public:
  // The right to work. Its holder polls `cancelled` and stops once it is set.
  struct Turn {
    std::shared_ptr<std::atomic<bool>> cancelled;
    std::unique_lock<std::mutex> work;
  };

  // Cancels earlier turns and waits until their holders have stopped. A later request may already
  // have cancelled the returned turn.
  Turn Take() {
    auto mine = std::make_shared<std::atomic<bool>>(false);
    {
      const std::scoped_lock lock(mutex_);
      if (latest_) *latest_ = true;
      latest_ = mine;
      if (closed_) *mine = true;
    }
    return {std::move(mine), std::unique_lock(work_)};
  }

  // Cancels the latest turn.
  void Cancel() {
    const std::scoped_lock lock(mutex_);
    if (latest_) *latest_ = true;
  }

  // Cancels all turns from now on.
  void Close() {
    const std::scoped_lock lock(mutex_);
    closed_ = true;
    if (latest_) *latest_ = true;
  }

 private:
  std::mutex mutex_;  // guards the two members below
  std::shared_ptr<std::atomic<bool>> latest_;
  bool closed_ = false;
  std::mutex work_;
};

}  // namespace sightline
