// SPDX-License-Identifier: Apache-2.0
// Quotas and names that a job store refuses.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Bytes of the different files that the client holds, or of all clients.
int64_t StoredBytes(SqlTransaction& sql, const std::optional<std::string>& client);

// In that state, of the client or of all.
int CountJobRows(SqlTransaction& sql, JobState state, const std::optional<std::string>& client);

// RESOURCE_EXHAUSTED (QUOTA_EXCEEDED).
absl::Status QuotaExceeded(const std::string& what, int64_t has, int64_t allowed);

// Called after the change, which is undone if it goes too far.
absl::Status CheckStoredBytes(SqlTransaction& sql, const std::string& client,
                              const ClientQuota& quota);

// INVALID_ARGUMENT names the fields that are not UTF-8 without NUL.
absl::Status CheckPlainNames(const std::vector<std::pair<std::string, std::string>>& names,
                             const std::vector<JobFile>& files);

// NOT_FOUND (JOB_UNKNOWN).
absl::Status JobUnknown(const std::string& job_id);

// ABORTED.
absl::Status AttemptNotCurrent(const Attempt& attempt);

}  // namespace sightline
