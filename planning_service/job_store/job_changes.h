// SPDX-License-Identifier: Apache-2.0
// Changes of a job; each adds its event.
#pragma once

#include <string>

#include "planning_service/job_store/planning_job.h"
#include "planning_service/job_store/sql_database.h"

namespace sightline {

// Adds an event with the job's current state.
void AddEvent(SqlTransaction& sql, const std::string& type, const PlanningJob& job);

// Ends the job. The caller has set `state`, `message`, `failure` and `results` of the job.
void FinishJob(SqlTransaction& sql, const std::string& event_type, PlanningJob* job);

void FinishCancelledJob(SqlTransaction& sql, PlanningJob* job);

// Puts a running job back into the queue; a job that was asked to stop is cancelled instead.
// Returns true if the job is in the queue.
bool PutJobBack(SqlTransaction& sql, PlanningJob* job, bool crashed, bool advanced);

}  // namespace sightline
