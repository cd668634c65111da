// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/event_json.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/json/message_json.h"
#include "planning_service/jobs/planning_jobs.h"

namespace sightline {

std::string EventJson(const JobEvent& event) {
  const std::string time =
      absl::FormatTime("%Y-%m-%d%ET%H:%M:%E6SZ", event.time, absl::UTCTimeZone());
  return absl::StrCat("{\"event_id\":\"", event.sequence,
                      "\",\"type\":", nlohmann::json(event.type).dump(), ",\"time\":\"", time,
                      "\",\"job\":", MessageJson(PlanningJobToProto(event.job)), "}");
}

}  // namespace sightline
