// SPDX-License-Identifier: Apache-2.0
// Backup of the planning service's data folder while the service runs.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace sightline {

struct BackupReport {
  int64_t files = 0;         // of the backup: parts, tasks' files and results, each once
  int64_t copied_files = 0;  // that an earlier backup in the same folder did not have
  int64_t copied_bytes = 0;
};

// Copies jobs, recipes, uploads and results as they are at one moment from a data folder to a
// folder that is itself a data folder: `sightline serve --data COPY` serves it. Jobs that run at
// that moment run again there; their checkpoints are left out. A folder with an earlier backup
// becomes the new one, and only files that it lacks are copied. Until all is copied it holds the
// earlier backup.
//
// With `only_files` the database is not copied (it is elsewhere, and was copied before), and all
// files are. NOT_FOUND: `data_folder` has no jobs. FAILED_PRECONDITION: a service works or has
// worked with `backup_folder`, it holds the backup of another service, or it is the data folder or
// in it. DATA_LOSS: the bytes of a file are not those that were written, or a file that a job names
// is gone; nothing is concluded then. RESOURCE_EXHAUSTED, reason DISK_FULL. CANCELLED: `stop` was
// set.
absl::StatusOr<BackupReport> BackUp(const std::string& data_folder,
                                    const std::string& backup_folder, bool only_files,
                                    const std::atomic<bool>& stop);

}  // namespace sightline
