// SPDX-License-Identifier: Apache-2.0
// The job store over a SQL database, for the files that implement it: sql_*.cpp.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/job_checks.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/sql_database.h"
#include "planning_service/job_store/sql_job_store.h"

namespace sightline {

inline constexpr absl::Duration kLongestWait = absl::Hours(24 * 365);
// Most rows in one answer.
inline constexpr int kMaxRows = 10'000;

// Status of a Status or StatusOr.
inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

// Has two connections, so that reads do not wait until a write is on disk.
class SqlJobStore : public PlanningJobStore {
 public:
  SqlJobStore(std::unique_ptr<SqlDatabase> database, std::unique_ptr<SqlConnection> writer,
              std::unique_ptr<SqlConnection> reader, SteadyClock clock)
      : database_(std::move(database)),
        clock_(std::move(clock)),
        writer_(std::move(writer)),
        reader_(std::move(reader)) {}

  absl::StatusOr<bool> BeginService() override;
  absl::StatusOr<PlanningJob> Create(const NewPlanningJob& job, const ClientQuota& quota) override;
  absl::StatusOr<PlanningJob> Get(const std::string& job_id) override;
  absl::StatusOr<std::vector<PlanningJob>> List(const PlanningJobFilter& filter) override;
  absl::StatusOr<PlanningJob> RequestCancel(const std::string& job_id) override;
  absl::StatusOr<PlanningJob> WaitForChange(const std::string& job_id, int64_t revision,
                                            absl::Duration timeout) override;
  absl::StatusOr<Counts> Count(const std::optional<std::string>& client) override;
  absl::StatusOr<std::optional<PlanningJob>> Claim(
      const std::function<ClientQuota(const std::string& client)>& quota_of) override;
  absl::StatusOr<bool> ReportProgress(const Attempt& attempt, double progress,
                                      const std::string& message) override;
  absl::Status Succeed(const Attempt& attempt, const std::vector<JobFile>& results) override;
  absl::Status Fail(const Attempt& attempt, const JobFailure& failure) override;
  absl::Status MarkCancelled(const Attempt& attempt) override;
  absl::Status Requeue(const Attempt& attempt, bool crashed, bool advanced) override;
  absl::StatusOr<int> RequeueOrphans() override;
  absl::StatusOr<Recipe> GetRecipe(const std::string& client,
                                   const std::string& recipe_id) override;
  absl::Status PutRecipe(const Recipe& recipe, const ClientQuota& quota) override;
  absl::Status DeleteRecipe(const std::string& client, const std::string& recipe_id) override;
  absl::StatusOr<int> CountRecipes(const std::string& client) override;
  absl::Status AddUpload(const std::string& client, const JobFile& file,
                         const ClientQuota& quota) override;
  absl::StatusOr<std::optional<int64_t>> FindFile(const std::string& client,
                                                  const std::string& digest) override;
  absl::StatusOr<std::vector<JobEvent>> Events(int64_t after_sequence,
                                               const std::optional<std::string>& job_id,
                                               int limit) override;
  void WaitForEvent(int64_t after_sequence, absl::Duration timeout) override;
  absl::StatusOr<int64_t> NewestEvent() override;
  absl::StatusOr<bool> HasEvent(int64_t sequence) override;
  absl::StatusOr<int64_t> EventCursor(const std::string& receiver) override;
  absl::Status SetEventCursor(const std::string& receiver, int64_t sequence) override;
  bool HoldsReceiver(const std::string& receiver) override;
  absl::Status AdvanceServiceTime(absl::Duration by) override;
  absl::StatusOr<int> RemoveOlderThan(absl::Duration age) override;
  absl::StatusOr<std::set<std::string>> NamedDigests() override;

 private:
  template <typename Body>
  using ResultOf = std::invoke_result_t<Body, SqlTransaction&>;

  // Runs `body(sql)` in a transaction. Returns its result, or the error of a statement or of the
  // commit. An error of the body undoes everything.
  template <typename Body>
  static ResultOf<Body> InTransaction(SqlConnection* connection, SqlAccess access, Body body) {
    SIGHTLINE_RETURN_IF_ERROR(connection->Begin(access));
    SqlTransaction sql(connection);
    ResultOf<Body> result = body(sql);
    if (!sql.status().ok()) result = sql.status();
    if (!StatusOf(result).ok()) {
      connection->Rollback();
      return result;
    }
    if (absl::Status committed = connection->Commit(); !committed.ok()) {
      connection->Rollback();
      return committed;
    }
    return result;
  }

  template <typename Body>
  ResultOf<Body> Read(Body body) {
    std::lock_guard lock(read_mutex_);
    return InTransaction(reader_.get(), SqlAccess::kRead, std::move(body));
  }

  template <typename Body>
  ResultOf<Body> Write(Body body) {
    ResultOf<Body> result = [&] {
      std::lock_guard lock(write_mutex_);
      return InTransaction(writer_.get(), SqlAccess::kWrite, std::move(body));
    }();
    // Also after an error: a commit whose answer was lost may have succeeded.
    Changed();
    return result;
  }

  // As Write, with `body(sql, owner)`. If the owner number has changed with the connection, jobs of
  // the old number get the new one, unless another process has taken them meanwhile.
  template <typename Body>
  auto WriteAsOwner(Body body) -> std::invoke_result_t<Body, SqlTransaction&, int64_t> {
    SIGHTLINE_ASSIGN_OR_RETURN(const int64_t owner, database_->Owner());
    auto result = Write([&](SqlTransaction& sql) {
      own_numbers_.insert(owner);
      for (const int64_t number : own_numbers_) {
        if (number == owner) continue;
        sql.Run("UPDATE job SET owner = $1 WHERE owner = $2 AND state = 'RUNNING'",
                {owner, number});
      }
      return body(sql, owner);
    });
    if (StatusOf(result).ok()) {
      std::lock_guard lock(write_mutex_);
      own_numbers_ = {owner};
    }
    return result;
  }

  // Runs `body(sql, job)` if the attempt is the job's current one; else ABORTED.
  template <typename Body>
  auto WriteAttempt(const Attempt& attempt, Body body)
      -> std::invoke_result_t<Body, SqlTransaction&, PlanningJob*> {
    using Result = std::invoke_result_t<Body, SqlTransaction&, PlanningJob*>;
    return WriteAsOwner([&](SqlTransaction& sql, int64_t owner) -> Result {
      auto job =
          FindJobRow(sql, "job_id = $1 AND attempts = $2 AND owner = $3 AND state = 'RUNNING'",
                     {attempt.job_id, int64_t{attempt.number}, owner});
      if (!job) {
        last_progress_event_.erase(attempt.job_id);
        return AttemptNotCurrent(attempt);
      }
      return body(sql, &*job);
    });
  }

  void Changed();
  int64_t Changes();

  // Waits until the number of changes differs from `seen`, another process may have made a change,
  // or `end` is reached.
  void AwaitChange(int64_t seen, std::chrono::steady_clock::time_point end);

  // End of a wait that begins now.
  static std::chrono::steady_clock::time_point EndOf(absl::Duration timeout);

  const std::unique_ptr<SqlDatabase> database_;
  const SteadyClock clock_;

  std::mutex write_mutex_;
  const std::unique_ptr<SqlConnection> writer_;  // guarded by write_mutex_, as the next two
  // Owner numbers that jobs of this store may have.
  std::set<int64_t> own_numbers_;
  std::map<std::string, std::chrono::steady_clock::time_point> last_progress_event_;  // by job

  std::mutex read_mutex_;
  const std::unique_ptr<SqlConnection> reader_;  // guarded by read_mutex_

  std::mutex change_mutex_;
  std::condition_variable changed_;
  int64_t changes_ = 0;  // guarded by change_mutex_
};

}  // namespace sightline
