// SPDX-License-Identifier: Apache-2.0
// Tables of the job store, and the migration of older versions.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Makes the tables, or migrates them to this program's version, within the writing transaction of
// `transaction`. FAILED_PRECONDITION: the tables are of a newer version. `name`: name of the
// database, for messages.
absl::Status MigrateJobSchema(const std::string& name, SqlTransaction* transaction);

}  // namespace sightline
