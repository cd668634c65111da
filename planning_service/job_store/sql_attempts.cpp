// SPDX-License-Identifier: Apache-2.0
// Statements about the attempts of jobs: claims, progress, ends.
#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/job_changes.h"
#include "planning_service/job_store/job_checks.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/plain_text.h"
#include "planning_service/job_store/sql_job_store_impl.h"

namespace sightline {
namespace {

constexpr size_t kMaxMessageBytes = 64 << 10;
constexpr auto kProgressEventInterval = std::chrono::seconds(1);

}  // namespace

absl::StatusOr<std::optional<PlanningJob>> SqlJobStore::Claim(
    const std::function<ClientQuota(const std::string& client)>& quota_of) {
  // Workers poll this method. If the queue is empty, it does not wait for the writers' lock.
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto waiting, Read([](SqlTransaction& sql) -> absl::StatusOr<bool> {
        return !sql.Run("SELECT 1 FROM job WHERE state = 'QUEUED' LIMIT 1").empty();
      }));
  if (!waiting) return std::nullopt;

  return WriteAsOwner([&](SqlTransaction& sql,
                          int64_t owner) -> absl::StatusOr<std::optional<PlanningJob>> {
    std::map<std::string, int64_t> running;
    for (const SqlRow& row :
         sql.Run("SELECT client, COUNT(*) FROM job WHERE state = 'RUNNING' GROUP BY client")) {
      running[row.Text(0)] = row.Int(1);
    }
    // The first of every client and priority, by (-priority, running jobs, sequence).
    std::optional<std::tuple<int64_t, int64_t, int64_t>> best;
    for (const SqlRow& row : sql.Run("SELECT client, priority, MIN(sequence) FROM job"
                                     " WHERE state = 'QUEUED' GROUP BY client, priority")) {
      const std::string client = row.Text(0);
      if (running[client] >= quota_of(client).max_running_jobs) continue;
      const std::tuple<int64_t, int64_t, int64_t> rank(-row.Int(1), running[client], row.Int(2));
      if (!best || rank < *best) best = rank;
    }
    if (!best) return std::nullopt;
    const SqlRows claimed = sql.Run(
        "UPDATE job SET state = 'RUNNING', owner = $2, attempts = attempts + 1,"
        " started_us = $3, revision = revision + 1 WHERE sequence = $1 RETURNING job_id",
        {std::get<2>(*best), owner, UnixMicros(absl::Now())});
    if (claimed.empty()) return std::nullopt;
    return FindJob(sql, claimed.front().Text(0));
  });
}

absl::StatusOr<bool> SqlJobStore::ReportProgress(const Attempt& attempt, double progress,
                                                 const std::string& message) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::StatusOr<bool> {
    const PlanningJob before = *job;
    // Progress never goes back; NaN changes nothing.
    job->progress = std::max(job->progress, std::min(progress, 1.0));
    job->message = ToPlainText(message, kMaxMessageBytes);
    if (job->progress == before.progress && job->message == before.message) {
      return job->cancel_requested;
    }
    ++job->revision;
    sql.Run("UPDATE job SET progress = $2, message = $3, revision = $4 WHERE job_id = $1",
            {job->job_id, job->progress, job->message, job->revision});
    const auto now = clock_();
    const auto last = last_progress_event_.find(job->job_id);
    if (last == last_progress_event_.end() || now - last->second >= kProgressEventInterval) {
      AddEvent(sql, "progress", *job);
      last_progress_event_[job->job_id] = now;
    }
    return job->cancel_requested;
  });
}

absl::Status SqlJobStore::Succeed(const Attempt& attempt, const std::vector<JobFile>& results) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({}, results));
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    job->state = JobState::kSucceeded;
    job->progress = 1;
    job->message.clear();  // it described running work
    job->results = results;
    FinishJob(sql, "done", job);
    last_progress_event_.erase(job->job_id);
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::Fail(const Attempt& attempt, const JobFailure& failure) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    job->state = JobState::kFailed;
    job->failure = {failure.code, ToPlainText(failure.reason, kMaxMessageBytes),
                    ToPlainText(failure.message, kMaxMessageBytes)};
    FinishJob(sql, "failed", job);
    last_progress_event_.erase(job->job_id);
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::MarkCancelled(const Attempt& attempt) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    FinishCancelledJob(sql, job);
    last_progress_event_.erase(job->job_id);
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::Requeue(const Attempt& attempt, bool crashed, bool advanced) {
  return WriteAttempt(attempt, [&](SqlTransaction& sql, PlanningJob* job) -> absl::Status {
    PutJobBack(sql, job, crashed, advanced);
    return absl::OkStatus();
  });
}

absl::StatusOr<int> SqlJobStore::RequeueOrphans() {
  return WriteAsOwner([&](SqlTransaction& sql, int64_t own) -> absl::StatusOr<int> {
    int requeued = 0;
    for (const SqlRow& row : sql.Run("SELECT DISTINCT owner FROM job WHERE state = 'RUNNING'")) {
      const int64_t owner = row.Int(0);
      if (owner == own) continue;
      SIGHTLINE_ASSIGN_OR_RETURN(const auto gone, database_->IsOwnerGone(sql.connection(), owner));
      if (!gone) continue;
      // The attempt cannot report any more; its last progress shows how far it got.
      for (const SqlRow& orphan :
           sql.Run(absl::StrCat("SELECT ", kJobColumns,
                                ", progress > crash_progress FROM job"
                                " WHERE state = 'RUNNING' AND owner = $1 ORDER BY sequence"),
                   {owner})) {
        PlanningJob job = JobOfRow(orphan);
        const bool advanced = orphan.Int(21) != 0;
        if (PutJobBack(sql, &job, true, advanced)) ++requeued;
      }
    }
    return requeued;
  });
}

}  // namespace sightline
