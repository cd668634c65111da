// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/sql_job_store.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/database_identity.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/job_schema.h"
#include "planning_service/job_store/postgres_database.h"
#include "planning_service/job_store/sql_job_store_impl.h"
#include "planning_service/job_store/sqlite_database.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;

// Interval between queries of a shared database for changes by other processes.
constexpr absl::Duration kPollInterval = absl::Milliseconds(500);

}  // namespace

void SqlJobStore::Changed() {
  {
    std::lock_guard lock(change_mutex_);
    ++changes_;
  }
  changed_.notify_all();
}

int64_t SqlJobStore::Changes() {
  std::lock_guard lock(change_mutex_);
  return changes_;
}

void SqlJobStore::AwaitChange(int64_t seen, steady_clock::time_point end) {
  if (database_->IsShared()) {
    end = std::min(end, steady_clock::now() + absl::ToChronoMilliseconds(kPollInterval));
  }
  std::unique_lock lock(change_mutex_);
  changed_.wait_until(lock, end, [&] { return changes_ != seen; });
}

steady_clock::time_point SqlJobStore::EndOf(absl::Duration timeout) {
  // Very long waits are cut, because the clock's arithmetic would overflow.
  return steady_clock::now() +
         absl::ToChronoMilliseconds(std::clamp(timeout, absl::ZeroDuration(), kLongestWait));
}

absl::StatusOr<bool> SqlJobStore::BeginService() {
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<bool> {
    SIGHTLINE_ASSIGN_OR_RETURN(const std::string instance, database_->Instance(sql.connection()));
    return SettleDatabaseIdentity(sql, instance);
  });
}

absl::Status SqlJobStore::AdvanceServiceTime(absl::Duration by) {
  if (by < absl::ZeroDuration() || by > kLongestWait) {
    return absl::InvalidArgumentError(absl::StrCat("service time advances by 0 to ",
                                                   absl::FormatDuration(kLongestWait), ", not by ",
                                                   absl::FormatDuration(by)));
  }
  // Only one of several processes advances the time; otherwise it would run too fast.
  if (!database_->Holds("service_time")) return absl::OkStatus();
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run("UPDATE counter SET value = value + $1 WHERE name = 'service_us'",
            {absl::ToInt64Microseconds(by)});
    return absl::OkStatus();
  });
}

absl::StatusOr<int> SqlJobStore::RemoveOlderThan(absl::Duration age) {
  const int64_t age_us =
      absl::ToInt64Microseconds(std::clamp(age, absl::ZeroDuration(), 100 * kLongestWait));
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<int> {
    const SqlRows now = sql.Run(absl::StrCat("SELECT ", kServiceTime));
    const int64_t limit_us = (now.empty() ? 0 : now.front().Int(0)) - age_us;
    const std::string old =
        absl::StrCat("state IN ", kFinishedStates, " AND finished_service_us < $1");
    sql.Run(absl::StrCat("DELETE FROM named_file WHERE holder IN ('file', 'result')"
                         " AND holder_id IN (SELECT job_id FROM job WHERE ",
                         old, ")"),
            {limit_us});
    const SqlRows removed =
        sql.Run(absl::StrCat("DELETE FROM job WHERE ", old, " RETURNING job_id"), {limit_us});
    sql.Run(
        "DELETE FROM named_file WHERE holder = 'upload' AND made_service_us < $1"
        " AND NOT EXISTS (SELECT 1 FROM named_file AS other WHERE other.client ="
        " named_file.client AND other.digest = named_file.digest AND other.holder <> 'upload')",
        {limit_us});
    sql.Run(
        "DELETE FROM event WHERE made_service_us < $1 AND (made_service_us < $2 OR NOT EXISTS"
        " (SELECT 1 FROM receiver WHERE receiver.sequence < event.sequence))",
        {limit_us, limit_us - age_us});
    return static_cast<int>(removed.size());
  });
}

absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqlJobStore(
    std::unique_ptr<SqlDatabase> database, SteadyClock clock) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto writer, database->Connect());
  SIGHTLINE_ASSIGN_OR_RETURN(auto reader, database->Connect());
  SIGHTLINE_RETURN_IF_ERROR(writer->Begin(SqlAccess::kWrite));
  SqlTransaction sql(writer.get());
  absl::Status migrated = MigrateJobSchema(database->Name(), &sql);
  if (migrated.ok()) migrated = writer->Commit();
  if (!migrated.ok()) {
    writer->Rollback();
    return migrated;
  }
  return std::make_unique<SqlJobStore>(std::move(database), std::move(writer), std::move(reader),
                                       std::move(clock));
}

absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqliteJobStore(const std::string& file) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto database, OpenSqliteDatabase(file));
  return OpenSqlJobStore(std::move(database));
}

absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenPostgresJobStore(
    const std::string& connection) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto database, OpenPostgresDatabase(connection));
  return OpenSqlJobStore(std::move(database));
}

}  // namespace sightline
