// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/job_rows.h"

#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// States are words in the database, for people who look into it.
constexpr std::pair<JobState, const char*> kStates[] = {{JobState::kQueued, "QUEUED"},
                                                        {JobState::kRunning, "RUNNING"},
                                                        {JobState::kSucceeded, "SUCCEEDED"},
                                                        {JobState::kFailed, "FAILED"},
                                                        {JobState::kCancelled, "CANCELLED"}};

}  // namespace

std::string StateText(JobState state) {
  for (const auto& [known, text] : kStates) {
    if (known == state) return text;
  }
  return "";
}

JobState StateOf(const std::string& text) {
  for (const auto& [state, known] : kStates) {
    if (known == text) return state;
  }
  return JobState::kFailed;
}

int64_t UnixMicros(absl::Time time) {
  return time == absl::InfinitePast() ? 0 : absl::ToUnixMicros(time);
}

absl::Time TimeOfMicros(int64_t micros) {
  return micros == 0 ? absl::InfinitePast() : absl::FromUnixMicros(micros);
}

PlanningJob JobOfRow(const SqlRow& row) {
  PlanningJob job;
  job.job_id = row.Text(0);
  job.sequence = row.Int(1);
  job.client = row.Text(2);
  job.kind = row.Text(3);
  job.request_id = row.Text(4);
  job.fingerprint = row.Text(5);
  job.priority = static_cast<int>(row.Int(6));
  job.state = StateOf(row.Text(7));
  job.progress = row.Real(8);
  job.message = row.Text(9);
  job.cancel_requested = row.Int(10) != 0;
  job.attempts = static_cast<int>(row.Int(11));
  job.crashes = static_cast<int>(row.Int(12));
  job.failure = {static_cast<absl::StatusCode>(row.Int(13)), row.Text(14), row.Text(15)};
  job.created = TimeOfMicros(row.Int(16));
  job.started = TimeOfMicros(row.Int(17));
  job.finished = TimeOfMicros(row.Int(18));
  job.revision = row.Int(19);
  job.traceparent = row.Text(20);
  return job;
}

JobFile FileOfRow(const SqlRow& row, size_t first_column) {
  return {row.Text(first_column), row.Text(first_column + 1), row.Int(first_column + 2)};
}

std::optional<PlanningJob> FindJobRow(SqlTransaction& sql, const std::string& where,
                                      const std::vector<SqlValue>& parameters) {
  const SqlRows rows =
      sql.Run(absl::StrCat("SELECT ", kJobColumns, " FROM job WHERE ", where), parameters);
  if (rows.empty()) return std::nullopt;
  return JobOfRow(rows.front());
}

std::vector<JobFile> FilesOf(SqlTransaction& sql, const FileHolder& holder) {
  std::vector<JobFile> files;
  for (const SqlRow& row :
       sql.Run("SELECT name, digest, size_bytes FROM named_file"
               " WHERE holder_id = $1 AND holder = $2 AND client = $3 ORDER BY place",
               {holder.id, holder.kind, holder.client})) {
    files.push_back(FileOfRow(row, 0));
  }
  return files;
}

void ReplaceFiles(SqlTransaction& sql, const FileHolder& holder,
                  const std::vector<JobFile>& files) {
  sql.Run("DELETE FROM named_file WHERE holder_id = $1 AND holder = $2 AND client = $3",
          {holder.id, holder.kind, holder.client});
  for (size_t i = 0; i < files.size(); ++i) {
    sql.Run(absl::StrCat("INSERT INTO named_file (client, holder, holder_id, place, name, digest,"
                         " size_bytes, made_service_us) VALUES ($1, $2, $3, $4, $5, $6, $7, ",
                         kServiceTime, ")"),
            {holder.client, holder.kind, holder.id, static_cast<int64_t>(i), files[i].name,
             files[i].digest, files[i].size_bytes});
  }
}

std::optional<PlanningJob> FindJob(SqlTransaction& sql, const std::string& job_id) {
  auto job = FindJobRow(sql, "job_id = $1", {job_id});
  if (!job) return std::nullopt;
  const SqlRows task = sql.Run("SELECT task FROM job WHERE job_id = $1", {job_id});
  if (!task.empty()) job->task = task.front().Bytes(0);
  job->files = FilesOf(sql, {job->client, "file", job_id});
  job->results = FilesOf(sql, {job->client, "result", job_id});
  return job;
}

int64_t NextNumber(SqlTransaction& sql, const std::string& counter) {
  const SqlRows rows =
      sql.Run("UPDATE counter SET value = value + 1 WHERE name = $1 RETURNING value", {counter});
  return rows.empty() ? 0 : rows.front().Int(0);
}

}  // namespace sightline
