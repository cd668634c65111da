// SPDX-License-Identifier: Apache-2.0
// Stops long work that is no longer wanted.
#pragma once

#include <atomic>
#include <functional>

#include "absl/status/status.h"

namespace sightline {

// Long work calls this check at intervals. An error (a deadline passed, the server stops) ends the
// work and is its result. An empty function never ends it.
using StopCheck = std::function<absl::Status()>;

inline absl::Status CheckStop(const StopCheck& stop) { return stop ? stop() : absl::OkStatus(); }

// True if another thread has set the flag that ends the work. Null: the work cannot be cancelled.
inline bool IsCancelled(const std::atomic<bool>* cancelled) {
  return cancelled != nullptr && cancelled->load(std::memory_order_relaxed);
}

}  // namespace sightline
