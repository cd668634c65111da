// SPDX-License-Identifier: Apache-2.0
// Backup of the planning service's data folder while the service runs.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace sightline {

struct BackupReport {
  int64_t files = 0;         // in the backup: parts, files of tasks, results; each counts once
  int64_t copied_files = 0;  // files that an earlier backup in the same folder lacked
  int64_t copied_bytes = 0;
};

// Copies jobs, recipes, uploads and results, in their state at one moment, from a data folder to a
// folder that is a data folder itself: `sightline serve --data COPY` serves it. Jobs that run at
// that moment run again there; their checkpoints are not copied. If the folder holds an earlier
// backup, only the files that it lacks are copied. It stays the earlier backup until the copy is
// complete.
//
// With `only_files` all files are copied but not the database, which is elsewhere and was copied
// before. NOT_FOUND: `data_folder` has no jobs. FAILED_PRECONDITION: a service works or has worked
// with `backup_folder`; `backup_folder` holds the backup of another service; or it is the data
// folder or lies in it. DATA_LOSS: a file is damaged, or a file that a job names is gone; the
// earlier backup then stays. RESOURCE_EXHAUSTED, reason DISK_FULL. CANCELLED: `stop` was set.
absl::StatusOr<BackupReport> BackUp(const std::string& data_folder,
                                    const std::string& backup_folder, bool only_files,
                                    const std::atomic<bool>& stop);

}  // namespace sightline
