// SPDX-License-Identifier: Apache-2.0
// Statements that answer clients' questions about jobs.
#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/job_changes.h"
#include "planning_service/job_store/job_checks.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/plain_text.h"
#include "planning_service/job_store/random_number.h"
#include "planning_service/job_store/sql_job_store_impl.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr size_t kMaxFilterValues = 100;

// SQL condition that the column has one of `values`, which are added to `parameters`.
std::string IsOneOf(const std::string& column, const std::vector<std::string>& values,
                    std::vector<SqlValue>* parameters) {
  std::vector<std::string> places;
  for (const std::string& value : values) {
    parameters->emplace_back(value);
    places.push_back(absl::StrCat("$", parameters->size()));
  }
  return absl::StrCat(column, " IN (", absl::StrJoin(places, ", "), ")");
}

// Positions of all queued jobs in the queue, from 0.
constexpr char kQueue[] =
    "(SELECT job_id AS queued_id, ROW_NUMBER() OVER (ORDER BY priority DESC, sequence) - 1"
    " AS jobs_ahead FROM job WHERE state = 'QUEUED') AS queue";
constexpr size_t kJobsAheadColumn = 21;  // behind kJobColumns

void CountJobsAhead(SqlTransaction& sql, PlanningJob* job) {
  if (job->state != JobState::kQueued) return;
  const SqlRows rows = sql.Run(
      "SELECT COUNT(*) FROM job WHERE state = 'QUEUED'"
      " AND (priority > $1 OR (priority = $1 AND sequence < $2))",
      {int64_t{job->priority}, job->sequence});
  if (!rows.empty()) job->jobs_ahead = rows.front().Int(0);
}

}  // namespace

absl::StatusOr<PlanningJob> SqlJobStore::Create(const NewPlanningJob& job,
                                                const ClientQuota& quota) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"client", job.client},
                                             {"kind", job.kind},
                                             {"request_id", job.request_id},
                                             {"fingerprint", job.fingerprint}},
                                            job.files));
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<PlanningJob> {
    if (!job.request_id.empty()) {
      const auto known = FindJobRow(sql, "client = $1 AND request_id = $2 AND request_id <> ''",
                                    {job.client, job.request_id});
      if (known && known->fingerprint != job.fingerprint) {
        return WithErrorInfo(absl::AlreadyExistsError(
                                 absl::StrCat("request_id \"", job.request_id,
                                              "\" was used for another task, job ", known->job_id)),
                             "REQUEST_ID_REUSED", {{"job_id", known->job_id}});
      }
      if (known) {
        auto whole = FindJob(sql, known->job_id);
        if (!whole) return sql.status();
        CountJobsAhead(sql, &*whole);
        return *std::move(whole);
      }
    }
    const int queued = CountJobRows(sql, JobState::kQueued, job.client);
    if (queued >= quota.max_queued_jobs) {
      return QuotaExceeded(absl::StrCat("max_queued_jobs of client ", job.client), queued + 1,
                           quota.max_queued_jobs);
    }
    PlanningJob made;
    made.job_id = absl::StrFormat("job-%016x%016x", RandomBits(), RandomBits());
    made.sequence = NextNumber(sql, "job");
    made.client = job.client;
    made.kind = job.kind;
    made.request_id = job.request_id;
    made.traceparent = job.traceparent;
    made.fingerprint = job.fingerprint;
    made.task = job.task;
    made.files = job.files;
    made.priority = job.priority;
    made.created = absl::FromUnixMicros(absl::ToUnixMicros(absl::Now()));
    made.revision = 1;
    sql.Run(
        "INSERT INTO job (job_id, sequence, client, kind, request_id, fingerprint, task,"
        " priority, state, created_us, revision, traceparent)"
        " VALUES ($1, $2, $3, $4, $5, $6, $7, $8, 'QUEUED', $9, $10, $11)",
        {made.job_id, made.sequence, made.client, made.kind, made.request_id, made.fingerprint,
         SqlBytes{made.task}, int64_t{made.priority}, UnixMicros(made.created), made.revision,
         made.traceparent});
    ReplaceFiles(sql, {made.client, "file", made.job_id}, made.files);
    AddEvent(sql, "accepted", made);
    SIGHTLINE_RETURN_IF_ERROR(CheckStoredBytes(sql, made.client, quota));
    CountJobsAhead(sql, &made);
    return made;
  });
}

absl::StatusOr<PlanningJob> SqlJobStore::Get(const std::string& job_id) {
  if (!IsPlainText(job_id)) return JobUnknown(job_id);
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<PlanningJob> {
    auto job = FindJob(sql, job_id);
    if (!job) return JobUnknown(job_id);
    CountJobsAhead(sql, &*job);
    return *std::move(job);
  });
}

absl::StatusOr<std::vector<PlanningJob>> SqlJobStore::List(const PlanningJobFilter& filter) {
  std::vector<std::string> states;
  for (const JobState state : filter.states) states.push_back(StateText(state));
  if (states.size() > kMaxFilterValues || filter.kinds.size() > kMaxFilterValues) {
    return absl::InvalidArgumentError(
        absl::StrCat("a list of states or kinds must have at most ", kMaxFilterValues, " values"));
  }
  std::vector<std::pair<std::string, std::string>> names;
  for (const std::string& kind : filter.kinds) names.emplace_back("kinds", kind);
  if (filter.client) names.emplace_back("client", *filter.client);
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames(names, {}));

  std::vector<SqlValue> parameters = {int64_t{std::clamp(filter.limit, 1, kMaxRows)}};
  std::vector<std::string> conditions = {"sequence > 0"};
  if (filter.client) conditions.push_back(IsOneOf("client", {*filter.client}, &parameters));
  if (!states.empty()) conditions.push_back(IsOneOf("state", states, &parameters));
  if (!filter.kinds.empty()) conditions.push_back(IsOneOf("kind", filter.kinds, &parameters));
  if (filter.before_sequence > 0) {
    parameters.emplace_back(filter.before_sequence);
    conditions.push_back(absl::StrCat("sequence < $", parameters.size()));
  }
  const std::string where = absl::StrJoin(conditions, " AND ");
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<std::vector<PlanningJob>> {
    std::vector<PlanningJob> jobs;
    std::map<std::string, size_t> places;
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT ", kJobColumns, ", COALESCE(queue.jobs_ahead, 0) FROM job",
                              " LEFT JOIN ", kQueue, " ON queue.queued_id = job.job_id WHERE ",
                              where, " ORDER BY sequence DESC LIMIT $1"),
                 parameters)) {
      jobs.push_back(JobOfRow(row));
      if (jobs.back().state == JobState::kQueued) {
        jobs.back().jobs_ahead = row.Int(kJobsAheadColumn);
      }
      places[jobs.back().job_id] = jobs.size() - 1;
    }
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT holder_id, name, digest, size_bytes FROM named_file"
                              " WHERE holder = 'result' AND holder_id IN (SELECT job_id FROM job"
                              " WHERE ",
                              where, " ORDER BY sequence DESC LIMIT $1) ORDER BY holder_id, place"),
                 parameters)) {
      const auto place = places.find(row.Text(0));
      if (place != places.end()) jobs[place->second].results.push_back(FileOfRow(row, 1));
    }
    return jobs;
  });
}

absl::StatusOr<PlanningJob> SqlJobStore::RequestCancel(const std::string& job_id) {
  if (!IsPlainText(job_id)) return JobUnknown(job_id);
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<PlanningJob> {
    auto job = FindJob(sql, job_id);
    if (!job) return JobUnknown(job_id);
    if (job->state == JobState::kQueued) {
      FinishCancelledJob(sql, &*job);
    } else if (job->state == JobState::kRunning && !job->cancel_requested) {
      job->cancel_requested = true;
      ++job->revision;
      sql.Run("UPDATE job SET cancel_requested = 1, revision = $2 WHERE job_id = $1",
              {job_id, job->revision});
    }
    return *std::move(job);
  });
}

absl::StatusOr<PlanningJob> SqlJobStore::WaitForChange(const std::string& job_id, int64_t revision,
                                                       absl::Duration timeout) {
  if (!IsPlainText(job_id)) return JobUnknown(job_id);
  const auto end = EndOf(timeout);
  while (true) {
    const int64_t seen = Changes();
    const auto now = Read([&](SqlTransaction& sql) -> absl::StatusOr<int64_t> {
      const SqlRows rows = sql.Run("SELECT revision FROM job WHERE job_id = $1", {job_id});
      if (rows.empty()) return JobUnknown(job_id);
      return rows.front().Int(0);
    });
    if (!now.ok()) return now.status();
    if (*now > revision || std::chrono::steady_clock::now() >= end) return Get(job_id);
    AwaitChange(seen, end);
  }
}

absl::StatusOr<PlanningJobStore::Counts> SqlJobStore::Count(
    const std::optional<std::string>& client) {
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<Counts> {
    Counts counts;
    counts.queued = CountJobRows(sql, JobState::kQueued, client);
    counts.running = CountJobRows(sql, JobState::kRunning, client);
    counts.stored_bytes = StoredBytes(sql, client);
    return counts;
  });
}

}  // namespace sightline
