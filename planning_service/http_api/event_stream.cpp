// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/event_stream.h"

#include <chrono>
#include <cstdint>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/json/message_json.h"
#include "planning_service/http/http_reply.h"
#include "planning_service/http_api/request_body.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;

// Time until the end of the server or of the client is noticed.
constexpr absl::Duration kWait = absl::Seconds(1);
constexpr std::chrono::seconds kHeartbeat(15);

bool IsFinal(const std::string& type) {
  return type == "done" || type == "failed" || type == "cancelled";
}

// Type of the event that leads to this state.
std::string StateEventType(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return "accepted";
    case JobState::kRunning:
      return "progress";
    case JobState::kSucceeded:
      return "done";
    case JobState::kFailed:
      return "failed";
    case JobState::kCancelled:
      return "cancelled";
  }
  return "progress";
}

std::string EventText(const std::string& id, const std::string& type, const PlanningJob& job) {
  return absl::StrCat(id.empty() ? "" : absl::StrCat("id: ", id, "\n"), "event: ", type,
                      "\ndata: ", MessageJson(PlanningJobToProto(job)), "\n\n");
}

}  // namespace

void StreamEvents(HttpExchange& exchange, PlanningJobs* jobs, const Client& client,
                  const std::string& job_id) {
  int64_t sequence = 0;
  const std::string last_id = exchange.request().Header("last-event-id");
  if (!last_id.empty()) {
    absl::StatusOr<int64_t> last =
        ReadInteger("Last-Event-ID", last_id, 0, std::numeric_limits<int64_t>::max());
    if (!last.ok()) return ReplyError(exchange, last.status());
    sequence = *last;
  }
  // The newest event is read before the job, so that no later event is left out.
  const absl::StatusOr<int64_t> newest = jobs->NewestEvent();
  if (!newest.ok()) return ReplyError(exchange, newest.status());
  const absl::StatusOr<bool> is_known = jobs->KnowsEvent(sequence);
  if (!is_known.ok()) return ReplyError(exchange, is_known.status());
  absl::StatusOr<PlanningJob> job = jobs->Get(client, job_id);
  if (!job.ok()) return ReplyError(exchange, job.status());
  if (!*is_known) sequence = *newest;
  absl::StatusOr<std::vector<JobEvent>> events =
      jobs->WaitForEvents(client, job_id, sequence, absl::ZeroDuration());
  if (!events.ok()) return ReplyError(exchange, events.status());
  if (*is_known && job->IsFinished() && events->empty() && !last_id.empty()) {
    // Status 204 tells a browser not to connect again.
    return ReplyText(exchange, 204, {}, "", "");
  }
  if (!exchange
           .Begin(200,
                  {{"Content-Type", "text/event-stream"},
                   {"Cache-Control", "no-store"},
                   // Buffering proxies would delay events.
                   {"X-Accel-Buffering", "no"}},
                  std::nullopt)
           .ok()) {
    return;
  }
  if (exchange.request().method == "HEAD") return exchange.End().IgnoreError();
  if (!exchange.Write("retry: 2000\n\n").ok()) return;
  if (!*is_known) {
    // The events that the receiver missed are unknown. It gets the present state, with an id to
    // continue from.
    const std::string text = EventText(absl::StrCat(*newest), StateEventType(job->state), *job);
    if (!exchange.Write(text).ok()) return;
    if (job->IsFinished()) return exchange.End().IgnoreError();
  }
  Clock::time_point last_sent = Clock::now();
  while (exchange.IsWanted()) {
    // The job is read before its events: if it is finished here, its last event is there too.
    job = jobs->Get(client, job_id);
    if (job.ok())
      events = jobs->WaitForEvents(client, job_id, sequence,
                                   job->IsFinished() ? absl::ZeroDuration() : kWait);
    // The body is not completed, so the client knows that it has to connect again.
    if (!job.ok() || !events.ok()) return;
    for (const JobEvent& event : *events) {
      if (!exchange.Write(EventText(absl::StrCat(event.sequence), event.type, event.job)).ok()) {
        return;
      }
      sequence = event.sequence;
      last_sent = Clock::now();
      if (IsFinal(event.type)) return exchange.End().IgnoreError();
    }
    if (job->IsFinished() && events->empty()) {
      // Retention has removed the events of an old job, but its state is still known.
      if (exchange.Write(EventText("", StateEventType(job->state), *job)).ok()) {
        exchange.End().IgnoreError();
      }
      return;
    }
    if (Clock::now() - last_sent >= kHeartbeat) {
      if (!exchange.Write(": still here\n\n").ok()) return;
      last_sent = Clock::now();
    }
  }
  // A server that ends closes the stream as complete; clients connect again to its successor.
  exchange.End().IgnoreError();
}

}  // namespace sightline
