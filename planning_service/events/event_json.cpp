#include "planning_service/events/event_json.h"

#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "planning_service/jobs/planning_jobs.h"

namespace sightline {

std::string EventJson(const JobEvent& event) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string job;
  // Fails only for text that is not UTF-8; an event without its details is better than none.
  if (!google::protobuf::util::MessageToJsonString(PlanningJobToProto(event.job), &job, options)
           .ok()) {
    job = nlohmann::json{{"job_id", event.job.job_id}}.dump(
        -1, ' ', false, nlohmann::json::error_handler_t::replace);
  }
  const std::string time =
      absl::FormatTime("%Y-%m-%d%ET%H:%M:%E6SZ", event.time, absl::UTCTimeZone());
  return absl::StrCat("{\"event_id\":\"", event.sequence,
                      "\",\"type\":", nlohmann::json(event.type).dump(), ",\"time\":\"", time,
                      "\",\"job\":", job, "}");
}

}  // namespace sightline
