// SPDX-License-Identifier: Apache-2.0
// Changes of a job, each with its event.
#pragma once

#include <string>

#include "planning_service/job_store/planning_job.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Adds an event with the job's present state.
void AddEvent(SqlTransaction& sql, const std::string& type, const PlanningJob& job);

// Ends the job; `state`, `message`, `failure` and `results` are as they shall be.
void FinishJob(SqlTransaction& sql, const std::string& event_type, PlanningJob* job);

void FinishCancelledJob(SqlTransaction& sql, PlanningJob* job);

// Puts a running job back. One that was asked to stop has stopped, and is not run again for that.
// Returns whether it is in the queue.
bool PutJobBack(SqlTransaction& sql, PlanningJob* job, bool crashed, bool advanced);

}  // namespace sightline
