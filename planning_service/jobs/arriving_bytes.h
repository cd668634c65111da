// SPDX-License-Identifier: Apache-2.0
// Bytes of uploads that have not ended, by client, so that quotas count them while they arrive.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace sightline {

// Thread-safe. Counts the uploads of this process: of several servers on one database each has its
// own.
class ArrivingBytes {
 public:
  // The bytes of one upload; they count as long as it lives.
  class Upload {
   public:
    Upload(ArrivingBytes* all, std::string client) : all_(all), client_(std::move(client)) {}
    Upload(Upload&& other) noexcept
        : all_(other.all_),
          client_(other.client_),
          size_bytes_(std::exchange(other.size_bytes_, 0)) {}
    Upload& operator=(Upload&&) = delete;
    ~Upload() { Release(); }

    // Adds bytes; returns the present bytes of all uploads of the client.
    int64_t Add(int64_t bytes) {
      size_bytes_ += bytes;
      return all_->Change(client_, bytes);
    }
    // Takes the bytes of this upload away again.
    void Release() { all_->Change(client_, -std::exchange(size_bytes_, 0)); }

   private:
    ArrivingBytes* all_;
    std::string client_;
    int64_t size_bytes_ = 0;
  };

 private:
  int64_t Change(const std::string& client, int64_t bytes) {
    std::lock_guard lock(mutex_);
    const int64_t sum = bytes_[client] += bytes;
    if (sum == 0) bytes_.erase(client);
    return sum;
  }

  std::mutex mutex_;
  std::map<std::string, int64_t> bytes_;
};

}  // namespace sightline
