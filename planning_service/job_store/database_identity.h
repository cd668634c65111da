// SPDX-License-Identifier: Apache-2.0
// Identity of the database, and where it is stored.
//
// A database has a random identity, made when a service first works with it and kept by backups and
// restores. Beside it stands the instance that a service last worked with, for example the inode of
// the file. A restored database has the identity of the original and another instance.
//
// Events that were delivered after the backup are unknown to a restored database, and it would give
// their ids to other events: receivers that leave out known ids would then miss these. A service
// that finds another instance therefore continues at an id that follows from the time, 2048 a
// millisecond, so that services of one backup that was restored twice differ, too; at the largest
// id + 2^32 if the clock is behind that. Ids stay below 2^53, where JSON numbers are exact, until
// 2109.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

struct DatabaseIdentity {
  // 32 hexadecimal digits of the database; and for every restore since a dot and eight digits of
  // that restore, so that two services of one backup differ.
  std::string identity;
  std::string instance;  // empty: a backup that no service was started with
  // An unchanged backup: no job came and none ran.
  bool is_unchanged_copy = false;
};

// True if `descendant` is `ancestor` or was restored from a copy of it.
bool DescendsFrom(const DatabaseIdentity& descendant, const DatabaseIdentity& ancestor);

// Identity as stored; none before a service of this version has worked with the database.
std::optional<DatabaseIdentity> ReadDatabaseIdentity(SqlTransaction& sql);

// Makes the identity if there is none, and moves event ids on if the database is a copy or may be
// one. Returns whether ids were moved. `instance` is not empty.
bool SettleDatabaseIdentity(SqlTransaction& sql, const std::string& instance);

// Identity of the jobs in an SQLite file that is not open; none if an older version made it.
absl::StatusOr<std::optional<DatabaseIdentity>> ReadSqliteIdentity(const std::string& file);

// Marks a new copy as unchanged.
absl::Status MarkSqliteCopy(const std::string& file);

}  // namespace sightline
