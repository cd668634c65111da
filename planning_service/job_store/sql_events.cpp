// SPDX-License-Identifier: Apache-2.0
// Events and how far their receivers have come.
#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/job_checks.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/plain_text.h"
#include "planning_service/job_store/sql_job_store_impl.h"

namespace sightline {

absl::StatusOr<std::vector<JobEvent>> SqlJobStore::Events(int64_t after_sequence,
                                                          const std::optional<std::string>& job_id,
                                                          int limit) {
  if (job_id && !IsPlainText(*job_id)) return std::vector<JobEvent>{};
  std::vector<SqlValue> parameters = {after_sequence, int64_t{std::clamp(limit, 1, kMaxRows)}};
  if (job_id) parameters.emplace_back(*job_id);
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<std::vector<JobEvent>> {
    std::vector<JobEvent> events;
    std::map<int64_t, size_t> places;
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT sequence, type, time_us, job_id, client, kind, state,"
                              " progress, message, failure_code, failure_reason, failure_message,"
                              " revision, request_id, priority, attempts FROM event"
                              " WHERE sequence > $1",
                              job_id ? " AND job_id = $3" : "", " ORDER BY sequence LIMIT $2"),
                 parameters)) {
      JobEvent event;
      event.sequence = row.Int(0);
      event.type = row.Text(1);
      event.time = TimeOfMicros(row.Int(2));
      event.job.job_id = row.Text(3);
      event.job.client = row.Text(4);
      event.job.kind = row.Text(5);
      event.job.state = StateOf(row.Text(6));
      event.job.progress = row.Real(7);
      event.job.message = row.Text(8);
      event.job.failure = {static_cast<absl::StatusCode>(row.Int(9)), row.Text(10), row.Text(11)};
      event.job.revision = row.Int(12);
      event.job.request_id = row.Text(13);
      event.job.priority = static_cast<int>(row.Int(14));
      event.job.attempts = static_cast<int>(row.Int(15));
      places[event.sequence] = events.size();
      events.push_back(std::move(event));
    }
    if (events.empty()) return events;
    std::vector<SqlValue> range = {events.front().sequence, events.back().sequence};
    if (job_id) range.emplace_back(*job_id);
    for (const SqlRow& row :
         sql.Run(absl::StrCat("SELECT event_sequence, name, digest, size_bytes FROM event_result"
                              " JOIN event ON event.sequence = event_sequence"
                              " WHERE event_sequence >= $1 AND event_sequence <= $2",
                              job_id ? " AND event.job_id = $3" : "",
                              " ORDER BY event_sequence, place"),
                 range)) {
      const auto place = places.find(row.Int(0));
      if (place != places.end()) events[place->second].job.results.push_back(FileOfRow(row, 1));
    }
    return events;
  });
}

void SqlJobStore::WaitForEvent(int64_t after_sequence, absl::Duration timeout) {
  const auto end = EndOf(timeout);
  while (true) {
    const int64_t seen = Changes();
    const absl::StatusOr<int64_t> last = NewestEvent();
    if ((last.ok() && *last > after_sequence) || std::chrono::steady_clock::now() >= end) return;
    AwaitChange(seen, end);
  }
}

absl::StatusOr<int64_t> SqlJobStore::NewestEvent() {
  return Read([](SqlTransaction& sql) -> absl::StatusOr<int64_t> {
    const SqlRows rows = sql.Run("SELECT value FROM counter WHERE name = 'event'");
    return rows.empty() ? 0 : rows.front().Int(0);
  });
}

absl::StatusOr<bool> SqlJobStore::HasEvent(int64_t sequence) {
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<bool> {
    return !sql.Run("SELECT 1 FROM event WHERE sequence = $1", {sequence}).empty();
  });
}

absl::StatusOr<int64_t> SqlJobStore::EventCursor(const std::string& receiver) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"receiver", receiver}}, {}));
  // Makes the receiver known: from now on events are kept for it.
  return Write([&](SqlTransaction& sql) -> absl::StatusOr<int64_t> {
    sql.Run("INSERT INTO receiver (name, sequence) VALUES ($1, 0) ON CONFLICT (name) DO NOTHING",
            {receiver});
    const SqlRows rows = sql.Run("SELECT sequence FROM receiver WHERE name = $1", {receiver});
    return rows.empty() ? 0 : rows.front().Int(0);
  });
}

absl::Status SqlJobStore::SetEventCursor(const std::string& receiver, int64_t sequence) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"receiver", receiver}}, {}));
  // A late report of a process that held the receiver before must not move the cursor back.
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run(
        "INSERT INTO receiver (name, sequence) VALUES ($1, $2) ON CONFLICT (name) DO UPDATE"
        " SET sequence = excluded.sequence WHERE receiver.sequence < excluded.sequence",
        {receiver, sequence});
    return absl::OkStatus();
  });
}

bool SqlJobStore::HoldsReceiver(const std::string& receiver) {
  return database_->Holds(absl::StrCat("receiver/", receiver));
}

}  // namespace sightline
