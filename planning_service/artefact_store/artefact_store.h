// SPDX-License-Identifier: Apache-2.0
// Stores files in a folder, each under the SHA-256 of its bytes.
//
// A file is written under a temporary name, flushed to disk and renamed, so that a file under its
// digest is always complete. Several processes may share the folder.
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

// Writes a new file. Its destructor removes the file if it was not committed.
class ArtefactWriter {
 public:
  ~ArtefactWriter();
  ArtefactWriter(const ArtefactWriter&) = delete;
  ArtefactWriter& operator=(const ArtefactWriter&) = delete;

  // RESOURCE_EXHAUSTED, reason DISK_FULL.
  absl::Status Write(const std::string& bytes);
  int64_t size_bytes() const { return size_bytes_; }
  // Frees the disk space of the bytes so far; bytes written afterwards count for the digest only.
  // Commit then fails.
  void DiscardBytes();
  // The digest of all bytes; Write must not be called afterwards. INVALID_ARGUMENT, reason
  // DIGEST_MISMATCH: `expected_digest` is not empty and differs from the digest.
  absl::StatusOr<std::string> Digest(const std::string& expected_digest);
  // Gives the file its final name and returns its digest. Errors as for Digest.
  absl::StatusOr<std::string> Commit(const std::string& expected_digest);

 private:
  friend class ArtefactStore;
  struct Impl;
  explicit ArtefactWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
  int64_t size_bytes_ = 0;
};

// While it exists, no process removes files from the folder. The kernel releases it when its
// process ends, even by a crash.
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
  // Makes the folder; removes unfinished files of earlier processes that are older than a day by
  // their file times. `reserve_bytes`: no file is accepted when the disk has less free space.
  static absl::StatusOr<std::unique_ptr<ArtefactStore>> Open(const std::string& folder,
                                                             int64_t reserve_bytes);

  // RESOURCE_EXHAUSTED, reason DISK_FULL.
  absl::StatusOr<std::unique_ptr<ArtefactWriter>> NewFile();
  // Stores a copy of a file (sharing blocks if the file system can) and returns digest and size.
  struct Added {
    std::string digest;
    int64_t size_bytes = 0;
  };
  absl::StatusOr<Added> AddFile(const std::string& path);

  bool Has(const std::string& digest) const;
  // Digests of all complete files.
  std::set<std::string> Digests() const;
  // NOT_FOUND: no such file, or `digest` is not a digest.
  absl::StatusOr<std::string> Path(const std::string& digest) const;
  // As Path, but checks the bytes on disk; DATA_LOSS: their digest is another one. A file that was
  // checked is read again only if its inode, time of change or size has changed.
  absl::StatusOr<std::string> CheckedPath(const std::string& digest) const;
  // Up to `limit` bytes from `offset` on; empty at the end. Does not check the digest.
  absl::StatusOr<std::string> Read(const std::string& digest, int64_t offset, int64_t limit) const;
  // Copies the file to `path`, read-only, for a job. DATA_LOSS: the digest of the bytes on disk is
  // another one.
  absl::Status Materialise(const std::string& digest, const std::string& path) const;

  // Removes files that `keep` does not name and whose file times are older than `min_age` (younger
  // ones may belong to a job that is being created). Returns the bytes freed; removes nothing while
  // an ArtefactHold exists.
  absl::StatusOr<int64_t> RemoveAllBut(const std::set<std::string>& keep, absl::Duration min_age);
  // Waits until a removal that is under way has ended, then blocks further ones.
  absl::StatusOr<std::unique_ptr<ArtefactHold>> Hold();

  // True if the disk has more free space than the reserve.
  bool HasRoom() const;

 private:
  ArtefactStore(std::string folder, int64_t reserve_bytes);
  // State of a file at the time of the check of its digest.
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
