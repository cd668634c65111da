// SPDX-License-Identifier: Apache-2.0
// Reads the messages of a `sightline --progress=json` command on stderr.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "planning_service/job_store/planning_job.h"

namespace sightline {

// The last progress that a command reported; `fraction` in [0, 1].
struct JobProgress {
  double fraction = 0;
  std::string message;
};

// Lines of JSON that the command means for us, among lines for people. Anything may come, in pieces
// of any size.
class CommandMessages {
 public:
  void Add(const char* bytes, size_t size);

  const JobProgress& progress() const { return progress_; }
  // Why it failed, if it said so.
  const std::optional<JobFailure>& failure() const { return failure_; }
  // The end of its text for people.
  const std::string& last_words() const { return last_words_; }

 private:
  void Line(const std::string& line);

  std::string rest_;
  JobProgress progress_;
  std::optional<JobFailure> failure_;
  std::string last_words_;
};

}  // namespace sightline
