// SPDX-License-Identifier: Apache-2.0
// PostgreSQL as an SqlDatabase.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// `connection`: connection text of libpq. Makes the schema `sightline` if it does not exist.
// UNAVAILABLE: cannot connect. FAILED_PRECONDITION: the database's encoding is not UTF8.
//
// Writing transactions, owners and roles are advisory locks, so no clock decides who lives. The
// next transaction reopens a lost connection. While that fails, attempts are spaced from 0.1 s to
// 5 s, and calls in between return UNAVAILABLE at once.
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenPostgresDatabase(const std::string& connection);

}  // namespace sightline
