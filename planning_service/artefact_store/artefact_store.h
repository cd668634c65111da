// SPDX-License-Identifier: Apache-2.0
// Files by the SHA-256 of their bytes, in a folder.
//
// A file is written under another name, flushed to disk and renamed: under its digest it is
// complete or not there. Several processes may share the folder.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

class ArtefactStore;

// A file on its way in. Removed if it is not committed.
class ArtefactWriter {
 public:
  ~ArtefactWriter();
  ArtefactWriter(const ArtefactWriter&) = delete;
  ArtefactWriter& operator=(const ArtefactWriter&) = delete;

  // RESOURCE_EXHAUSTED, reason DISK_FULL.
  absl::Status Write(const std::string& bytes);
  int64_t size_bytes() const { return size_bytes_; }
  // From now on bytes count for the digest only, and those on disk are given back. No Commit after
  // it.
  void DiscardBytes();
  // The digest of all bytes; nothing can be written after it. With `expected_digest` not empty:
  // INVALID_ARGUMENT, reason DIGEST_MISMATCH, if the bytes have another one.
  absl::StatusOr<std::string> Digest(const std::string& expected_digest);
  // Gives the file its name and returns its digest; errors as of Digest.
  absl::StatusOr<std::string> Commit(const std::string& expected_digest);

 private:
  friend class ArtefactStore;
  struct Impl;
  explicit ArtefactWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
  int64_t size_bytes_ = 0;
};

// As long as it lives no process removes files from the folder; the kernel lets go of it however
// its process ends.
class ArtefactHold {
 public:
  ~ArtefactHold();
  ArtefactHold(const ArtefactHold&) = delete;
  ArtefactHold& operator=(const ArtefactHold&) = delete;

 private:
  friend class ArtefactStore;
  explicit ArtefactHold(int fd) : fd_(fd) {}
  const int fd_;
};

// Thread-safe.
class ArtefactStore {
 public:
  // Makes the folder; removes half-written files of earlier processes that are more than a day old
  // by file times. `reserve_bytes`: free space of the disk below which nothing is taken in.
  static absl::StatusOr<std::unique_ptr<ArtefactStore>> Open(const std::string& folder,
                                                             int64_t reserve_bytes);

  // RESOURCE_EXHAUSTED, reason DISK_FULL.
  absl::StatusOr<std::unique_ptr<ArtefactWriter>> NewFile();
  // Takes a copy of a file (a link where the file system can) and returns digest and size.
  struct Added {
    std::string digest;
    int64_t size_bytes = 0;
  };
  absl::StatusOr<Added> AddFile(const std::string& path);

  bool Has(const std::string& digest) const;
  // Digests of all complete files.
  std::set<std::string> Digests() const;
  // NOT_FOUND; a `digest` that is none is NOT_FOUND too.
  absl::StatusOr<std::string> Path(const std::string& digest) const;
  // As Path, with the digest of the bytes on disk checked: DATA_LOSS if they are others. A file
  // that was checked is read again only when its inode, time of change or size is another.
  absl::StatusOr<std::string> CheckedPath(const std::string& digest) const;
  // Up to `limit` bytes from `offset` on; empty at the end. DATA_LOSS is not checked here.
  absl::StatusOr<std::string> Read(const std::string& digest, int64_t offset, int64_t limit) const;
  // Puts the file at `path` for a job to read: as a copy that the job may not change. Checks the
  // digest: DATA_LOSS if the bytes on disk are others.
  absl::Status Materialise(const std::string& digest, const std::string& path) const;

  // Removes files that `keep` does not name and that were not touched for `min_age` of file times
  // (they may belong to a job that is being created). Returns bytes freed: none while there is a
  // hold.
  absl::StatusOr<int64_t> RemoveAllBut(const std::set<std::string>& keep, absl::Duration min_age);
  // Waits until a removal that is under way has ended.
  absl::StatusOr<std::unique_ptr<ArtefactHold>> Hold();

  // Whether the disk has more than the reserve.
  bool HasRoom() const;

 private:
  ArtefactStore(std::string folder, int64_t reserve_bytes);
  // A file at the time when its digest was checked.
  struct Checked {
    uint64_t inode = 0;
    int64_t changed_ns = 0;
    int64_t size_bytes = 0;
    bool operator==(const Checked&) const = default;
  };

  const std::string folder_;
  const int64_t reserve_bytes_;
  mutable std::mutex checked_mutex_;
  mutable std::unordered_map<std::string, Checked> checked_;  // by digest, by checked_mutex_
};

}  // namespace sightline
