// SPDX-License-Identifier: Apache-2.0
// The JSON form of a job event for receivers.
#pragma once

#include <string>

#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

// {"event_id": "12", "type": "done", "time": "2026-01-31T12:00:00.000000Z", "job": {...}}, where
// `job` is MessageJson of the v1::PlanningJob, as in answers by HTTP, and the
// event_id grows from event to event. The same event gives the same bytes.
std::string EventJson(const JobEvent& event);

}  // namespace sightline
