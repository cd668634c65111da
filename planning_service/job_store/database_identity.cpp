// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/database_identity.h"

#include <cstdint>
#include <memory>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/random_number.h"
#include "planning_service/job_store/sqlite_database.h"

namespace sightline {
namespace {

constexpr int64_t kEventIdStep = int64_t{1} << 32;
// Ids of a restored copy continue at an id derived from the time, so that two restores differ. The
// ids stay below 2^53 until 2109 and fall behind the time below 2048 events a millisecond.
constexpr int64_t kEventIdsPerMs = 2048;
// Mark in the stored identity, before every restore since the database was last copied.
constexpr char kSinceCopy[] = ".~";
// Value of `copied_event` (the newest event at the time of the copy) if the database is no copy.
constexpr int64_t kNoCopy = -1;

// Runs `body(sql)` in a transaction on an SQLite file that no other process has open.
template <typename Body>
absl::Status InSqliteFile(const std::string& file, SqlAccess access, Body body) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto database, OpenSqliteDatabase(file));
  SIGHTLINE_ASSIGN_OR_RETURN(auto connection, database->Connect());
  SIGHTLINE_RETURN_IF_ERROR(connection->Begin(access));
  SqlTransaction sql(connection.get());
  body(sql);
  absl::Status status = sql.status();
  if (status.ok()) status = connection->Commit();
  if (!status.ok()) connection->Rollback();
  return status;
}

bool HasIdentityTable(SqlTransaction& sql) {
  return !sql.Run("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'database_identity'")
              .empty();
}

}  // namespace

bool DescendsFrom(const DatabaseIdentity& descendant, const DatabaseIdentity& ancestor) {
  return descendant.identity == ancestor.identity ||
         absl::StartsWith(descendant.identity, ancestor.identity + ".");
}

std::optional<DatabaseIdentity> ReadDatabaseIdentity(SqlTransaction& sql) {
  const SqlRows rows = sql.Run("SELECT identity, instance, copied_event FROM database_identity");
  if (rows.empty()) return std::nullopt;
  const int64_t copied_event = rows.front().Int(2);
  const bool is_unchanged =
      copied_event != kNoCopy &&
      sql.Run("SELECT 1 FROM event WHERE sequence > $1 LIMIT 1", {copied_event}).empty();
  std::string identity = rows.front().Text(0);
  // Reading an unchanged copy does not make another service of it.
  if (is_unchanged) identity = identity.substr(0, identity.find(kSinceCopy));
  return DatabaseIdentity{absl::StrReplaceAll(identity, {{kSinceCopy, "."}}), rows.front().Text(1),
                          is_unchanged};
}

bool SettleDatabaseIdentity(SqlTransaction& sql, const std::string& instance) {
  const std::optional<DatabaseIdentity> known = ReadDatabaseIdentity(sql);
  if (known && known->instance == instance) return false;
  if (known) {
    sql.Run(
        "UPDATE database_identity SET identity = identity || $1, instance = $2",
        {absl::StrCat(kSinceCopy, absl::Hex(static_cast<uint32_t>(RandomBits()), absl::kZeroPad8)),
         instance});
  } else {
    sql.Run("INSERT INTO database_identity (identity, instance, copied_event) VALUES ($1, $2, $3)",
            {absl::StrCat(absl::Hex(RandomBits(), absl::kZeroPad16),
                          absl::Hex(RandomBits(), absl::kZeroPad16)),
             instance, kNoCopy});
  }
  // A database without identity is new, or of an older version. The latter may be a restored copy,
  // unless it has no events. A known copy counts as restored even without events, which may have
  // followed it.
  const SqlRows moved = sql.Run(absl::StrCat("UPDATE counter SET value ="
                                             " CASE WHEN value < $1 THEN $1 ELSE value + $2 END"
                                             " WHERE name = 'event'",
                                             known ? "" : " AND value > 0", " RETURNING value"),
                                {absl::ToUnixMillis(absl::Now()) * kEventIdsPerMs, kEventIdStep});
  return !moved.empty();
}

absl::StatusOr<std::optional<DatabaseIdentity>> ReadSqliteIdentity(const std::string& file) {
  std::optional<DatabaseIdentity> identity;
  SIGHTLINE_RETURN_IF_ERROR(InSqliteFile(file, SqlAccess::kRead, [&](SqlTransaction& sql) {
    if (HasIdentityTable(sql)) identity = ReadDatabaseIdentity(sql);
  }));
  return identity;
}

absl::Status MarkSqliteCopy(const std::string& file) {
  return InSqliteFile(file, SqlAccess::kWrite, [](SqlTransaction& sql) {
    if (HasIdentityTable(sql)) {
      sql.Run(
          "UPDATE database_identity SET identity = replace(identity, '.~', '.'), instance = '',"
          " copied_event = (SELECT value FROM counter WHERE name = 'event')");
    }
  });
}

}  // namespace sightline
