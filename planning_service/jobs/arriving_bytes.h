// SPDX-License-Identifier: Apache-2.0
// Counts bytes of unfinished uploads by client, so that quotas include them while they arrive.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace sightline {

// Thread-safe. Counts only the uploads of this process, even if several servers share one
// database.
class ArrivingBytes {
 public:
  // The bytes of one upload; they count as long as this object exists.
  class Upload {
   public:
    Upload(ArrivingBytes* all, std::string client) : all_(all), client_(std::move(client)) {}
    Upload(Upload&& other) noexcept
        : all_(other.all_),
          client_(other.client_),
          size_bytes_(std::exchange(other.size_bytes_, 0)) {}
    Upload& operator=(Upload&&) = delete;
    ~Upload() { Release(); }

    // Adds bytes; returns the current bytes of all uploads of the client.
    int64_t Add(int64_t bytes) {
      size_bytes_ += bytes;
      return all_->Change(client_, bytes);
    }
    // Subtracts the bytes of this upload again.
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
