// SPDX-License-Identifier: Apache-2.0
// Identity of the database, and where it is stored.
//
// A database has a random identity, made when a service first works with it and kept by backups and
// restores. It also stores its instance, for example the inode of the file, at the last work of a
// service. A restored database has the identity of the original but is another instance.
//
// A restored database does not know events that were delivered after the backup. It would give
// their ids to other events, which receivers that skip known ids would miss. A service that finds
// another instance therefore continues at an id derived from the time, 2048 ids a millisecond, so
// that two restores of one backup also differ. If the clock is behind the largest id, it continues
// at that id + 2^32. Ids stay below 2^53, up to which JSON numbers are exact, until
// the year 2109.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

struct DatabaseIdentity {
  // 32 hexadecimal digits of the database, followed by a dot and eight digits for every restore, so
  // that two services restored from one backup differ.
  std::string identity;
  std::string instance;  // empty: a backup on which no service was started
  // True for an unchanged backup: no event since the copy, so no job was created and none ran.
  bool is_unchanged_copy = false;
};

// True if `descendant` is `ancestor` or was restored from a copy of it.
bool DescendsFrom(const DatabaseIdentity& descendant, const DatabaseIdentity& ancestor);

// The stored identity; nullopt before a service of this version has worked with the database.
std::optional<DatabaseIdentity> ReadDatabaseIdentity(SqlTransaction& sql);

// Makes the identity if there is none, and advances event ids if the database is or may be a copy.
// Returns true if ids were advanced. `instance` is not empty.
bool SettleDatabaseIdentity(SqlTransaction& sql, const std::string& instance);

// Identity of the jobs in an SQLite file that is not open; nullopt if an older version made it.
absl::StatusOr<std::optional<DatabaseIdentity>> ReadSqliteIdentity(const std::string& file);

// Marks a new copy as unchanged.
absl::Status MarkSqliteCopy(const std::string& file);

}  // namespace sightline
