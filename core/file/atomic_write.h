// SPDX-License-Identifier: Apache-2.0
// Files that appear whole or not at all.
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

// Files of this user alone, e.g. with content of a job.
inline constexpr mode_t kPrivateFile = 0600;

// A part of the name of every temporary file. The only owner of a folder may remove files of such
// names: a killed process left them.
inline constexpr char kUnfinishedMark[] = ".part-";

// A file that is written piece by piece. Without Commit nothing of it stays.
class UnfinishedFile {
 public:
  // `mode` is subject to the umask. NOT_FOUND: the folder does not exist. RESOURCE_EXHAUSTED: no
  // room. UNAVAILABLE: anything else, with the reason.
  static absl::StatusOr<UnfinishedFile> Make(const std::string& path, mode_t mode = 0666);

  UnfinishedFile(UnfinishedFile&& other) noexcept;
  UnfinishedFile& operator=(UnfinishedFile&&) = delete;
  ~UnfinishedFile();

  absl::Status Write(std::string_view bytes);
  // Gives the file its name, over an earlier file of that name. Nothing can be written after this.
  absl::Status Commit();
  // The temporary file, for programs that write by themselves.
  const std::string& temporary_path() const { return temporary_; }

 private:
  UnfinishedFile(std::string path, std::string temporary, int descriptor)
      : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {}
  absl::Status Failure(const char* what) const;

  std::string path_;
  std::string temporary_;  // empty: it has got its name
  int descriptor_ = -1;
};

// Writes `contents` in this way. Errors as of UnfinishedFile::Make.
absl::Status WriteFileAtomically(const std::string& path, std::string_view contents,
                                 mode_t mode = 0666);

}  // namespace sightline
