// SPDX-License-Identifier: Apache-2.0
// How long work learns that it is no longer wanted.
#pragma once

#include <atomic>
#include <functional>

#include "absl/status/status.h"

namespace sightline {

// Asked now and then by work that can take long; an error (a deadline that passed, a server that
// stops) ends the work and is its result. Empty: never.
using StopCheck = std::function<absl::Status()>;

inline absl::Status CheckStop(const StopCheck& stop) { return stop ? stop() : absl::OkStatus(); }

// Whether another thread has set the flag that ends the work. Null: the work cannot be cancelled.
inline bool IsCancelled(const std::atomic<bool>* cancelled) {
  return cancelled != nullptr && cancelled->load(std::memory_order_relaxed);
}

}  // namespace sightline
