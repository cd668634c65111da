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

// Separates the command's lines of JSON for programs from its lines for people. The bytes may be
// anything and may come in pieces of any size.
class CommandMessages {
 public:
  void Add(const char* bytes, size_t size);

  const JobProgress& progress() const { return progress_; }
  // Reason of the failure, if the command has stated one.
  const std::optional<JobFailure>& failure() const { return failure_; }
  // The end of the command's text for people.
  const std::string& last_words() const { return last_words_; }

 private:
  void Line(const std::string& line);

  std::string rest_;
  JobProgress progress_;
  std::optional<JobFailure> failure_;
  std::string last_words_;
};

}  // namespace sightline
