// SPDX-License-Identifier: Apache-2.0
// Writes files atomically: a file is complete or does not exist.
//
// The contents go to a temporary file beside the final one, which is flushed to disk and then
// renamed. A crash leaves the earlier file, never half of the new one.
#pragma once

#include <sys/types.h>

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// Mode of files that only this user may read, e.g. files with content of a job.
inline constexpr mode_t kPrivateFile = 0600;

// Part of the name of every temporary file. The exclusive owner of a folder may remove files with
// such names: a killed process has left them.
inline constexpr char kUnfinishedMark[] = ".part-";

// A file that is written piece by piece. Without Commit the destructor removes it.
class UnfinishedFile {
 public:
  // `mode` is subject to the umask. NOT_FOUND: the folder does not exist. RESOURCE_EXHAUSTED: no
  // room. UNAVAILABLE: anything else, with the reason.
  static absl::StatusOr<UnfinishedFile> Make(const std::string& path, mode_t mode = 0666);

  UnfinishedFile(UnfinishedFile&& other) noexcept;
  UnfinishedFile& operator=(UnfinishedFile&&) = delete;
  ~UnfinishedFile();

  absl::Status Write(std::string_view bytes);
  // Gives the file its name, replacing an earlier file. Nothing can be written after this.
  absl::Status Commit();
  // Path of the temporary file, for programs that write it themselves.
  const std::string& temporary_path() const { return temporary_; }

 private:
  UnfinishedFile(std::string path, std::string temporary, int descriptor)
      : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {}
  absl::Status Failure(const char* what) const;

  std::string path_;
  std::string temporary_;  // empty: the file has its final name
  int descriptor_ = -1;
};

// Writes `contents` atomically. Errors as UnfinishedFile::Make.
absl::Status WriteFileAtomically(const std::string& path, std::string_view contents,
                                 mode_t mode = 0666);

}  // namespace sightline
