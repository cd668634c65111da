// SPDX-License-Identifier: Apache-2.0
// SQLite as an SqlDatabase.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Opens the database file, or makes it in an existing folder. The object holds a lock on the file
// FILE.lock beside it, so only one process has the database at a time; the kernel releases the
// lock when the process ends, even by a crash. FAILED_PRECONDITION: another process has it.
// DATA_LOSS: the file is damaged.
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& file);

// Copies a database, in its state at one moment, to a new file; after an error there is no file.
// Another process may have the database open and write to it. NOT_FOUND: there is no database.
// DATA_LOSS: it is damaged.
absl::Status CopySqliteDatabase(const std::string& file, const std::string& to);

}  // namespace sightline
