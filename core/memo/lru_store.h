// SPDX-License-Identifier: Apache-2.0
// A store of values by key with a limit in bytes: the least recently used values are dropped first.
// Values that were not used for long can be dropped on request.
#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace sightline {

// Thread-safe. A value that was dropped lives on as long as somebody holds it.
template <typename Value>
class LruStore {
 public:
  explicit LruStore(int64_t max_bytes) : max_bytes_(max_bytes) {}

  // Replaces a value of the same key. RESOURCE_EXHAUSTED: the value alone exceeds the limit.
  absl::Status Put(const std::string& key, std::shared_ptr<const Value> value, int64_t bytes) {
    if (bytes > max_bytes_) {
      return absl::ResourceExhaustedError(
          absl::StrCat("needs ", bytes, " bytes, the server's limit is ", max_bytes_));
    }
    std::lock_guard lock(mutex_);
    Erase(key);
    while (bytes_ + bytes > max_bytes_) Erase(order_.back());
    order_.push_front(key);
    entries_[key] = {std::move(value), bytes, Clock::now(), order_.begin()};
    bytes_ += bytes;
    return absl::OkStatus();
  }

  // Null if unknown.
  std::shared_ptr<const Value> Get(const std::string& key) {
    std::lock_guard lock(mutex_);
    const auto it = entries_.find(key);
    if (it == entries_.end()) return nullptr;
    order_.splice(order_.begin(), order_, it->second.place);
    it->second.used = Clock::now();
    return it->second.value;
  }

  // Drops the values whose last Put or Get was not after `time`.
  void DropUnusedSince(std::chrono::steady_clock::time_point time) {
    std::lock_guard lock(mutex_);
    while (!order_.empty() && entries_[order_.back()].used <= time) Erase(order_.back());
  }

  int64_t count() const {
    std::lock_guard lock(mutex_);
    return static_cast<int64_t>(entries_.size());
  }
  int64_t bytes() const {
    std::lock_guard lock(mutex_);
    return bytes_;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Entry {
    std::shared_ptr<const Value> value;
    int64_t bytes = 0;
    Clock::time_point used;
    std::list<std::string>::iterator place;
  };

  // `key` is a copy, because it may be an element of order_.
  void Erase(std::string key) {
    const auto it = entries_.find(key);
    if (it == entries_.end()) return;
    bytes_ -= it->second.bytes;
    order_.erase(it->second.place);
    entries_.erase(it);
  }

  const int64_t max_bytes_;
  mutable std::mutex mutex_;
  std::list<std::string> order_;  // front: used last
  std::map<std::string, Entry> entries_;
  int64_t bytes_ = 0;
};

}  // namespace sightline
