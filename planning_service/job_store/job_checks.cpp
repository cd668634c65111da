// SPDX-License-Identifier: Apache-2.0
#include "planning_service/job_store/job_checks.h"

#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/plain_text.h"
#include "proto/status/rpc_status.h"

namespace sightline {

int64_t StoredBytes(SqlTransaction& sql, const std::optional<std::string>& client) {
  const std::string files = absl::StrCat("SELECT MAX(size_bytes) AS size_bytes FROM named_file",
                                         client ? " WHERE client = $1" : "", " GROUP BY digest");
  const SqlRows rows =
      sql.Run(absl::StrCat("SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM (", files,
                           ") AS files"),
              client ? std::vector<SqlValue>{*client} : std::vector<SqlValue>{});
  return rows.empty() ? 0 : rows.front().Int(0);
}

int CountJobRows(SqlTransaction& sql, JobState state, const std::optional<std::string>& client) {
  const SqlRows rows =
      client ? sql.Run("SELECT COUNT(*) FROM job WHERE state = $1 AND client = $2",
                       {StateText(state), *client})
             : sql.Run("SELECT COUNT(*) FROM job WHERE state = $1", {StateText(state)});
  return rows.empty() ? 0 : static_cast<int>(rows.front().Int(0));
}

absl::Status QuotaExceeded(const std::string& what, int64_t has, int64_t allowed) {
  return WithErrorInfo(
      absl::ResourceExhaustedError(absl::StrCat(what, ": ", has, ", allowed are ", allowed)),
      "QUOTA_EXCEEDED", {{"allowed", absl::StrCat(allowed)}});
}

absl::Status CheckStoredBytes(SqlTransaction& sql, const std::string& client,
                              const ClientQuota& quota) {
  const int64_t stored = StoredBytes(sql, client);
  if (stored <= quota.max_stored_bytes) return absl::OkStatus();
  return QuotaExceeded(absl::StrCat("max_stored_bytes of client ", client), stored,
                       quota.max_stored_bytes);
}

absl::Status CheckPlainNames(const std::vector<std::pair<std::string, std::string>>& names,
                             const std::vector<JobFile>& files) {
  std::vector<FieldViolation> violations;
  const auto check = [&violations](const std::string& field, const std::string& value) {
    if (IsPlainText(value)) return;
    violations.push_back(
        {field, absl::StrCat("is \"", absl::CHexEscape(value), "\", must be UTF-8 without NUL")});
  };
  for (const auto& [field, value] : names) check(field, value);
  for (size_t i = 0; i < files.size(); ++i) {
    check(absl::StrCat("files[", i, "].name"), files[i].name);
    check(absl::StrCat("files[", i, "].digest"), files[i].digest);
  }
  return InvalidFields(violations);
}

absl::Status JobUnknown(const std::string& job_id) {
  return WithErrorInfo(
      absl::NotFoundError(absl::StrCat("no job \"", absl::CHexEscape(job_id), "\"")),
      "JOB_UNKNOWN");
}

absl::Status AttemptNotCurrent(const Attempt& attempt) {
  return absl::AbortedError(absl::StrCat("attempt ", attempt.number, " of job ", attempt.job_id,
                                         " is not its current one"));
}

}  // namespace sightline
