// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/job_changes.h"

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "planning_service/job_store/job_rows.h"

namespace sightline {

void AddEvent(SqlTransaction& sql, const std::string& type, const PlanningJob& job) {
  const int64_t sequence = NextNumber(sql, "event");
  sql.Run(absl::StrCat("INSERT INTO event (sequence, type, time_us, job_id, client, kind, state,"
                       " progress, message, failure_code, failure_reason, failure_message,"
                       " revision, request_id, priority, attempts, made_service_us)"
                       " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15,"
                       " $16, ",
                       kServiceTime, ")"),
          {sequence, type, UnixMicros(absl::Now()), job.job_id, job.client, job.kind,
           StateText(job.state), job.progress, job.message, static_cast<int64_t>(job.failure.code),
           job.failure.reason, job.failure.message, job.revision, job.request_id,
           int64_t{job.priority}, int64_t{job.attempts}});
  for (size_t i = 0; i < job.results.size(); ++i) {
    sql.Run(
        "INSERT INTO event_result (event_sequence, place, name, digest, size_bytes)"
        " VALUES ($1, $2, $3, $4, $5)",
        {sequence, static_cast<int64_t>(i), job.results[i].name, job.results[i].digest,
         job.results[i].size_bytes});
  }
}

void FinishJob(SqlTransaction& sql, const std::string& event_type, PlanningJob* job) {
  job->cancel_requested = false;
  job->finished = absl::Now();
  ++job->revision;
  sql.Run(absl::StrCat("UPDATE job SET state = $2, progress = $3, message = $4,"
                       " cancel_requested = 0, failure_code = $5, failure_reason = $6,"
                       " failure_message = $7, finished_us = $8, revision = $9,"
                       " finished_service_us = ",
                       kServiceTime, " WHERE job_id = $1"),
          {job->job_id, StateText(job->state), job->progress, job->message,
           static_cast<int64_t>(job->failure.code), job->failure.reason, job->failure.message,
           UnixMicros(job->finished), job->revision});
  ReplaceFiles(sql, {job->client, "result", job->job_id}, job->results);
  AddEvent(sql, event_type, *job);
}

void FinishCancelledJob(SqlTransaction& sql, PlanningJob* job) {
  job->state = JobState::kCancelled;
  job->message = "cancelled";
  FinishJob(sql, "cancelled", job);
}

bool PutJobBack(SqlTransaction& sql, PlanningJob* job, bool crashed, bool advanced) {
  if (advanced) job->crashes = 0;
  if (crashed) ++job->crashes;
  sql.Run(
      "UPDATE job SET state = 'QUEUED', crashes = $2, revision = revision + 1 WHERE job_id = $1",
      {job->job_id, int64_t{job->crashes}});
  if (crashed) {
    sql.Run("UPDATE job SET crash_progress = progress WHERE job_id = $1", {job->job_id});
  }
  ++job->revision;
  if (!job->cancel_requested) return true;
  FinishCancelledJob(sql, job);
  return false;
}

}  // namespace sightline
