// SPDX-License-Identifier: Apache-2.0
// Reads files that a user names.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

// A regular file, open for reading. NOT_FOUND names the path and why it cannot be opened;
// INVALID_ARGUMENT: a folder, a pipe, a device, which could block or never end.
absl::StatusOr<File> OpenRegularFile(const std::string& path);

// All bytes of a regular file. Errors as above; INVALID_ARGUMENT also for more than `max_bytes`,
// before anything is read.
absl::StatusOr<std::string> ReadRegularFile(const std::string& path, uint64_t max_bytes);

}  // namespace sightline
