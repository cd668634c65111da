// SPDX-License-Identifier: Apache-2.0
// A planning job as the store keeps it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "core/job/job_store.h"

namespace sightline {

// A file of a job, either sent with its task or a result. Its bytes are in the artefact store.
struct JobFile {
  std::string name;    // path below the job's folder, with '/'
  std::string digest;  // SHA-256, lower-case hex
  int64_t size_bytes = 0;

  friend bool operator==(const JobFile&, const JobFile&) = default;
};

// Why a job failed.
struct JobFailure {
  absl::StatusCode code = absl::StatusCode::kOk;
  std::string reason;  // for programs, e.g. OUT_OF_MEMORY; may be empty
  std::string message;

  friend bool operator==(const JobFailure&, const JobFailure&) = default;
};

struct PlanningJob {
  std::string job_id;
  int64_t sequence = 0;  // order of acceptance
  std::string client;
  std::string kind;
  std::string request_id;
  std::string fingerprint;  // SHA-256 of task and files
  std::string task;         // v1::PlanningTask, serialised
  std::vector<JobFile> files;
  std::string traceparent;  // of the request that made it, for logs; may be empty
  int priority = 0;
  JobState state = JobState::kQueued;
  double progress = 0;  // [0, 1]
  std::string message;
  bool cancel_requested = false;  // for a running job
  int attempts = 0;               // how often it was started
  int crashes = 0;                // attempts in a row that ended without a stated reason
  JobFailure failure;
  std::vector<JobFile> results;
  // Times by the server's clock, only for display.
  absl::Time created = absl::InfinitePast();
  absl::Time started = absl::InfinitePast();
  absl::Time finished = absl::InfinitePast();
  int64_t revision = 0;  // grows with every change
  // Position of a queued job: number of queued jobs of all clients before it, by priority, then by
  // acceptance. Counted when the job is read; does not change `revision`; unset in events.
  std::optional<int64_t> jobs_ahead;

  bool IsFinished() const { return state >= JobState::kSucceeded; }
};

}  // namespace sightline
