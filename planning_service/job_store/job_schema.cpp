// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/job_schema.h"

#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// Types are PostgreSQL's; SQLite takes them for its own (BYTEA columns keep blobs as they are).
// Times are microseconds: *_us of the wall clock since 1970, *_service_us of service time.
const std::vector<std::string> kVersion1 = {
    // Numbers come from rows of this table, not from sequences of the database: sequences have
    // gaps, and their order is not the order of the commits.
    "CREATE TABLE counter (name TEXT PRIMARY KEY, value BIGINT NOT NULL)",
    "INSERT INTO counter (name, value) VALUES ('job', 0), ('event', 0), ('service_us', 0)",
    "CREATE TABLE job ("
    " job_id TEXT PRIMARY KEY,"
    " sequence BIGINT NOT NULL UNIQUE,"
    " client TEXT NOT NULL,"
    " kind TEXT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " fingerprint TEXT NOT NULL,"
    " task BYTEA NOT NULL,"
    " priority BIGINT NOT NULL,"
    " state TEXT NOT NULL,"
    " progress DOUBLE PRECISION NOT NULL DEFAULT 0,"
    " message TEXT NOT NULL DEFAULT '',"
    " cancel_requested BIGINT NOT NULL DEFAULT 0,"
    " owner BIGINT NOT NULL DEFAULT 0,"
    " attempts BIGINT NOT NULL DEFAULT 0,"
    " crashes BIGINT NOT NULL DEFAULT 0,"
    // Progress at the last crash.
    " crash_progress DOUBLE PRECISION NOT NULL DEFAULT -1,"
    " failure_code BIGINT NOT NULL DEFAULT 0,"
    " failure_reason TEXT NOT NULL DEFAULT '',"
    " failure_message TEXT NOT NULL DEFAULT '',"
    " created_us BIGINT NOT NULL,"
    " started_us BIGINT NOT NULL DEFAULT 0,"
    " finished_us BIGINT NOT NULL DEFAULT 0,"
    " finished_service_us BIGINT NOT NULL DEFAULT 0,"
    " revision BIGINT NOT NULL)",
    "CREATE UNIQUE INDEX job_request ON job (client, request_id) WHERE request_id <> ''",
    "CREATE INDEX job_queue ON job (state, client, priority, sequence)",
    "CREATE INDEX job_client ON job (client, sequence)",
    "CREATE TABLE recipe ("
    " client TEXT NOT NULL,"
    " recipe_id TEXT NOT NULL,"
    " kind TEXT NOT NULL,"
    " fingerprint TEXT NOT NULL,"
    " task BYTEA NOT NULL,"
    " PRIMARY KEY (client, recipe_id))",
    // Files that a client holds. `holder` is 'file' or 'result' of the job, 'recipe' or 'upload'
    // of `holder_id`, which is the digest for an upload.
    "CREATE TABLE named_file ("
    " client TEXT NOT NULL,"
    " holder TEXT NOT NULL,"
    " holder_id TEXT NOT NULL,"
    " place BIGINT NOT NULL,"
    " name TEXT NOT NULL,"
    " digest TEXT NOT NULL,"
    " size_bytes BIGINT NOT NULL,"
    " made_service_us BIGINT NOT NULL,"
    " PRIMARY KEY (holder_id, holder, client, place))",
    "CREATE INDEX named_file_digest ON named_file (client, digest, size_bytes)",
    // An event keeps its own copy of the job's data: the job may be removed before every receiver
    // knows.
    "CREATE TABLE event ("
    " sequence BIGINT PRIMARY KEY,"
    " type TEXT NOT NULL,"
    " time_us BIGINT NOT NULL,"
    " made_service_us BIGINT NOT NULL,"
    " job_id TEXT NOT NULL,"
    " client TEXT NOT NULL,"
    " kind TEXT NOT NULL,"
    " state TEXT NOT NULL,"
    " progress DOUBLE PRECISION NOT NULL,"
    " message TEXT NOT NULL,"
    " failure_code BIGINT NOT NULL,"
    " failure_reason TEXT NOT NULL,"
    " failure_message TEXT NOT NULL,"
    " revision BIGINT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " priority BIGINT NOT NULL,"
    " attempts BIGINT NOT NULL)",
    "CREATE INDEX event_job ON event (job_id, sequence)",
    "CREATE TABLE event_result ("
    " event_sequence BIGINT NOT NULL REFERENCES event (sequence) ON DELETE CASCADE,"
    " place BIGINT NOT NULL,"
    " name TEXT NOT NULL,"
    " digest TEXT NOT NULL,"
    " size_bytes BIGINT NOT NULL,"
    " PRIMARY KEY (event_sequence, place))",
    "CREATE TABLE receiver (name TEXT PRIMARY KEY, sequence BIGINT NOT NULL)",
};

// The request that a job came with; jobs of older programs have none.
const std::vector<std::string> kVersion2 = {
    "ALTER TABLE job ADD COLUMN traceparent TEXT NOT NULL DEFAULT ''",
};

// One row, made by the first service of this version: see database_identity.h.
const std::vector<std::string> kVersion3 = {
    "CREATE TABLE database_identity (identity TEXT NOT NULL, instance TEXT NOT NULL,"
    " copied_event BIGINT NOT NULL)",
};

// Step i leads from version i to i + 1. Steps that were released never change.
const std::vector<const std::vector<std::string>*> kSteps = {&kVersion1, &kVersion2, &kVersion3};

}  // namespace

absl::Status MigrateJobSchema(const std::string& name, SqlTransaction* transaction) {
  transaction->Run("CREATE TABLE IF NOT EXISTS schema_version (version BIGINT NOT NULL)");
  const SqlRows rows = transaction->Run("SELECT version FROM schema_version");
  if (!transaction->status().ok()) return transaction->status();
  const int64_t version = rows.empty() ? 0 : rows.front().Int(0);
  const auto newest = static_cast<int64_t>(kSteps.size());
  if (version > newest || version < 0) {
    return absl::FailedPreconditionError(absl::StrCat(name, ": the tables are of version ", version,
                                                      ", this program knows up to version ",
                                                      newest));
  }
  if (version == newest) return absl::OkStatus();
  for (int64_t step = version; step < newest; ++step) {
    for (const std::string& statement : *kSteps[step]) transaction->Run(statement);
  }
  transaction->Run(rows.empty() ? "INSERT INTO schema_version (version) VALUES ($1)"
                                : "UPDATE schema_version SET version = $1",
                   {newest});
  return transaction->status();
}

}  // namespace sightline
