// SPDX-License-Identifier: Apache-2.0
// SQLite behind the interface of SQL databases.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Opens the database file, or makes it in a folder that is there. The file FILE.lock beside it is
// locked as long as the object lives, so one process has it at a time; the kernel lets go of the
// lock however the process ends. FAILED_PRECONDITION: another one has it. DATA_LOSS: the file is
// damaged.
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& file);

// Copies a database, as it is at one moment, to a new file, which is complete or not there; another
// process may have it open and write to it meanwhile. NOT_FOUND: there is none. DATA_LOSS: it is
// damaged.
absl::Status CopySqliteDatabase(const std::string& file, const std::string& to);

}  // namespace sightline
