// SPDX-License-Identifier: Apache-2.0
// Checks of quotas and names for the job store.
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

// Bytes of the distinct files that the client holds, or that all clients hold.
int64_t StoredBytes(SqlTransaction& sql, const std::optional<std::string>& client);

// Number of jobs in that state, of the client or of all clients.
int CountJobRows(SqlTransaction& sql, JobState state, const std::optional<std::string>& client);

// RESOURCE_EXHAUSTED (QUOTA_EXCEEDED).
absl::Status QuotaExceeded(const std::string& what, int64_t has, int64_t allowed);

// To be called after the change, in its transaction: an error undoes the change.
absl::Status CheckStoredBytes(SqlTransaction& sql, const std::string& client,
                              const ClientQuota& quota);

// INVALID_ARGUMENT names the fields that are not valid UTF-8 or hold a NUL.
absl::Status CheckPlainNames(const std::vector<std::pair<std::string, std::string>>& names,
                             const std::vector<JobFile>& files);

// NOT_FOUND (JOB_UNKNOWN).
absl::Status JobUnknown(const std::string& job_id);

// ABORTED.
absl::Status AttemptNotCurrent(const Attempt& attempt);

}  // namespace sightline
