// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/worker_process/shared_memory.h"

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {

absl::StatusOr<SharedMemory> SharedMemory::Make(const char* name, size_t bytes) {
  SharedMemory memory(memfd_create(name, MFD_CLOEXEC));
  if (memory.fd_ < 0 || ftruncate(memory.fd_, static_cast<off_t>(bytes)) != 0) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no shared memory of ", bytes, " bytes: ", std::strerror(errno)));
  }
  return memory;
}

SharedMemory::~SharedMemory() {
  if (fd_ >= 0) close(fd_);
}

absl::StatusOr<void*> MapShared(int fd, size_t bytes) {
  void* data = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (data == MAP_FAILED) {
    return absl::ResourceExhaustedError(
        absl::StrCat("cannot map ", bytes, " bytes: ", std::strerror(errno)));
  }
  return data;
}

void SharedWriter::Write(const void* data, size_t bytes) {
  constexpr size_t kPiece = size_t{4} << 20;  // a millisecond or two
  const char* from = static_cast<const char*>(data);
  while (bytes > 0 && status_.ok()) {
    if (cancelled_ != nullptr && cancelled_->load(std::memory_order_relaxed)) {
      status_ = absl::CancelledError("shared memory");
      return;
    }
    const ssize_t written = write(fd_, from, std::min(bytes, kPiece));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      status_ = absl::ResourceExhaustedError(
          absl::StrCat("shared memory cannot be written: ", std::strerror(errno)));
      return;
    }
    from += written;
    bytes -= static_cast<size_t>(written);
  }
}

absl::StatusOr<SharedReader> SharedReader::Map(int fd) {
  struct stat state {};
  if (fstat(fd, &state) != 0) {
    return absl::InternalError(
        absl::StrCat("shared memory of unknown size: ", std::strerror(errno)));
  }
  const auto bytes = static_cast<size_t>(state.st_size);
  if (bytes == 0) return SharedReader(nullptr, 0);
  SIGHTLINE_ASSIGN_OR_RETURN(void* data, MapShared(fd, bytes));
  return SharedReader(std::shared_ptr<const char>(static_cast<const char*>(data),
                                                  [bytes](const char* mapped) {
                                                    munmap(const_cast<char*>(mapped), bytes);
                                                  }),
                      bytes);
}

std::span<const char> SharedReader::NextArray() {
  uint64_t size = 0;
  if (ok_ && bytes_ - place_ >= sizeof(size)) {
    std::memcpy(&size, data_.get() + place_, sizeof(size));
    place_ += sizeof(size);
  } else {
    ok_ = false;
  }
  if (!ok_ || size > bytes_ - place_) {
    ok_ = false;
    return {};
  }
  const std::span<const char> array(data_.get() + place_, size);
  constexpr size_t kAlignment = SharedWriter::kAlignment;
  place_ = std::min(bytes_, place_ + (size + kAlignment - 1) / kAlignment * kAlignment);
  return array;
}

}  // namespace sightline
