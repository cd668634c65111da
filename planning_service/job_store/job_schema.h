// SPDX-License-Identifier: Apache-2.0
// Tables of the job store and how older ones become newer ones.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Brings the tables to this program's version, or makes them, within the writing transaction of
// `transaction`. FAILED_PRECONDITION: they are of a newer version. `name`: of the database, for
// messages.
absl::Status MigrateJobSchema(const std::string& name, SqlTransaction* transaction);

}  // namespace sightline
