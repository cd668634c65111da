// SPDX-License-Identifier: Apache-2.0
// Caches values of a pure function that is called repeatedly with the same arguments.
#pragma once

#include <map>
#include <mutex>
#include <utility>

namespace sightline {

// Keeps up to `most` values, then forgets all of them. Thread-safe. Results do not depend on the
// kept values, because a key always has the same value.
template <typename Key, typename Value>
class Memo {
 public:
  explicit Memo(size_t most) : most_(most) {}

  template <typename Compute>
  Value Get(const Key& key, const Compute& compute) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto found = known_.find(key);
      if (found != known_.end()) return found->second;
    }
    // Without the lock: two threads may compute the same value, but none waits for another.
    Value value = compute();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (known_.size() >= most_) known_.clear();
    known_.emplace(key, value);
    return value;
  }

 private:
  size_t most_;
  std::mutex mutex_;
  std::map<Key, Value> known_;
};

}  // namespace sightline
