// SPDX-License-Identifier: Apache-2.0
// The job store over a SQL database.
#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "absl/status/statusor.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

using SteadyClock = std::function<std::chrono::steady_clock::time_point()>;

// Makes or migrates the tables. `clock` limits the rate of progress events. Errors as for
// OpenSqliteJobStore and OpenPostgresJobStore.
absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqlJobStore(
    std::unique_ptr<SqlDatabase> database,
    SteadyClock clock = [] { return std::chrono::steady_clock::now(); });

}  // namespace sightline
