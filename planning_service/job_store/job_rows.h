// SPDX-License-Identifier: Apache-2.0
// Converts rows of the job tables to values, and holds the statements that fetch them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "planning_service/job_store/planning_job.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Columns of table job in the order that JobOfRow takes them.
inline constexpr char kJobColumns[] =
    "job_id, sequence, client, kind, request_id, fingerprint, priority, state, progress, message, "
    "cancel_requested, attempts, crashes, failure_code, failure_reason, failure_message, "
    "created_us, started_us, finished_us, revision, traceparent";
inline constexpr char kServiceTime[] = "(SELECT value FROM counter WHERE name = 'service_us')";
inline constexpr char kFinishedStates[] = "('SUCCEEDED', 'FAILED', 'CANCELLED')";

// Owner of the names in a file list; see table named_file.
struct FileHolder {
  std::string client;
  std::string kind;
  std::string id;
};

// Names of states in the database; an unknown name counts as a failed job.
std::string StateText(JobState state);
JobState StateOf(const std::string& text);

// Conversion of times; 0 stands for "never".
int64_t UnixMicros(absl::Time time);
absl::Time TimeOfMicros(int64_t micros);

PlanningJob JobOfRow(const SqlRow& row);
// Name, digest and size from `first_column` on.
JobFile FileOfRow(const SqlRow& row, size_t first_column);

// The first job that fulfils the condition `where`, without its task and files.
std::optional<PlanningJob> FindJobRow(SqlTransaction& sql, const std::string& where,
                                      const std::vector<SqlValue>& parameters);

// Files in the order in which they were given.
std::vector<JobFile> FilesOf(SqlTransaction& sql, const FileHolder& holder);
void ReplaceFiles(SqlTransaction& sql, const FileHolder& holder, const std::vector<JobFile>& files);

// The job with its task, files and results.
std::optional<PlanningJob> FindJob(SqlTransaction& sql, const std::string& job_id);

// Next number of a counter that all processes share.
int64_t NextNumber(SqlTransaction& sql, const std::string& counter);

}  // namespace sightline
