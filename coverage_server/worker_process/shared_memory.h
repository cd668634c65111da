// SPDX-License-Identifier: Apache-2.0
// Memory that processes of one program share.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// A file in memory, which others map by its descriptor.
class SharedMemory {
 public:
  // RESOURCE_EXHAUSTED: no memory is left. `name` shows in /proc.
  static absl::StatusOr<SharedMemory> Make(const char* name, size_t bytes);

  SharedMemory(SharedMemory&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  SharedMemory& operator=(SharedMemory&&) = delete;
  ~SharedMemory();
  int fd() const { return fd_; }

 private:
  explicit SharedMemory(int fd) : fd_(fd) {}
  int fd_;
};

// Maps the first `bytes` of a descriptor, to be read and written. RESOURCE_EXHAUSTED.
absl::StatusOr<void*> MapShared(int fd, size_t bytes);

// Writes arrays one after the other.
class SharedWriter {
 public:
  // Writes to `fd` from its current offset; the caller keeps it open. Stops early when *cancelled.
  explicit SharedWriter(int fd, const std::atomic<bool>* cancelled = nullptr)
      : fd_(fd), cancelled_(cancelled) {}

  template <typename T>
  void PutAll(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kAlignment);
    const uint64_t bytes = values.size_bytes();
    Write(&bytes, sizeof(bytes));
    Write(values.data(), bytes);
    constexpr char kPadding[kAlignment] = {};
    Write(kPadding, (kAlignment - bytes % kAlignment) % kAlignment);
  }
  template <typename T>
  void Put(const T& value) {
    PutAll(std::span<const T>(&value, 1));
  }
  void PutText(std::string_view text) { PutAll(std::span<const char>(text)); }

  // RESOURCE_EXHAUSTED: something could not be written. CANCELLED.
  const absl::Status& status() const { return status_; }

  static constexpr size_t kAlignment = 8;

 private:
  void Write(const void* data, size_t bytes);

  int fd_;
  const std::atomic<bool>* cancelled_;
  absl::Status status_;
};

// Reads data that a SharedWriter has written. Its spans are valid as long as a copy of it exists.
class SharedReader {
 public:
  // Maps the whole file. RESOURCE_EXHAUSTED.
  static absl::StatusOr<SharedReader> Map(int fd);

  // If the array is missing, the result is empty and ok() is false from then on.
  template <typename T>
  std::span<const T> GetAll() {
    const std::span<const char> bytes = NextArray();
    if (bytes.size() % sizeof(T) != 0) ok_ = false;
    if (!ok_) return {};
    return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
  }
  template <typename T>
  T Get() {
    const std::span<const T> values = GetAll<T>();
    if (values.size() != 1) ok_ = false;
    return ok_ ? values[0] : T{};
  }
  std::string_view GetText() {
    const std::span<const char> text = GetAll<char>();
    return {text.data(), text.size()};
  }
  bool ok() const { return ok_; }

 private:
  SharedReader(std::shared_ptr<const char> data, size_t bytes)
      : data_(std::move(data)), bytes_(bytes) {}
  std::span<const char> NextArray();

  std::shared_ptr<const char> data_;
  size_t bytes_;
  size_t place_ = 0;
  bool ok_ = true;
};

}  // namespace sightline
