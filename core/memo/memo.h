// SPDX-License-Identifier: Apache-2.0
// Values of a pure function that is asked for the same again and again.
#pragma once

#include <map>
#include <mutex>
#include <utility>

namespace sightline {

// Keeps up to `most` values, then starts anew; may be used by several threads. Which values are
// kept never shows in a result, since the same key always gives the same value.
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
    // Unlocked: two threads may compute the same, none waits for another.
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
