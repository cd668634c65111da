// SPDX-License-Identifier: Apache-2.0
// Events of a job as text/event-stream (HTML standard, "Server-sent events").
#pragma once

#include <string>

#include "planning_service/http/http_exchange.h"
#include "planning_service/jobs/planning_jobs.h"

namespace sightline {

// Sends the events after the request's Last-Event-ID, or all events, until the job is finished,
// the client is gone or the server ends. Errors before the first byte are answered as usual.
void StreamEvents(HttpExchange& exchange, PlanningJobs* jobs, const Client& client,
                  const std::string& job_id);

}  // namespace sightline
