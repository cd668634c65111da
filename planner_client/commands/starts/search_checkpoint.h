// SPDX-License-Identifier: Apache-2.0
// Checkpoint of `sightline plan --checkpoint`: the same command continues after its process was
// ended.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/gain_model/record_replay_gain_model.h"
#include "planner_client/kept_answers/question_files.h"
#include "planning/multi_start/start_result.h"
#include "planning/strategy/planner.h"

namespace sightline {

// Inputs of a search that an open session does not keep.
struct SearchQuestion {
  // Digests of the inspection with all files that it refers to, and of measured points. They are
  // taken before the session opens, so that no change between digest and reading goes unnoticed.
  FileContents files;
  // Options that are neither in a file nor in the request: "pose prior 5 mm, ...".
  std::string options;
};

// A folder with the coverage server's answers to interrupted searches (`answers…`) and the
// results of finished ones (`start-SEED.json`). Several processes may use it for different
// searches.
class SearchCheckpoint {
 public:
  // A checkpoint without a folder, which keeps nothing.
  SearchCheckpoint() = default;
  // Opens the folder. Answers and results are stored under a digest of everything that they depend
  // on: the question's files, scenes, admissible uncertainties, the robot, fixed scans, and the
  // programs of client and server; results also depend on the request except its seed. Damaged
  // entries and those of another digest are reported on stderr and made again. INTERNAL if the
  // folder cannot be made. ABORTED if a file has changed since its digest was taken.
  static absl::StatusOr<SearchCheckpoint> Open(const std::string& folder,
                                               const PlanningSession& session,
                                               const SearchQuestion& question,
                                               const PlannerRequest& request,
                                               int64_t bound_evaluations);

  // Lets the session's gain model record its answers and replay the recorded ones of the search
  // with this name. INTERNAL if the file cannot be written.
  absl::Status KeepAnswers(const std::string& search, PlanningSession* session);
  // Restores the session's gain model from before KeepAnswers.
  void LeaveAnswers(PlanningSession* session);

  std::optional<StartResult> ResultOf(int64_t seed) const;
  // Stores the result and removes the search's answers, which are no longer needed.
  absl::Status KeepResult(const StartResult& start, const std::string& search) const;

 private:
  std::string AnswersFile(const std::string& search) const;
  std::string ResultFile(int64_t seed) const;

  std::string folder_;  // empty: nothing is kept
  std::string answers_fingerprint_, results_fingerprint_;
  RecordReplayGainModel* journal_ = nullptr;  // the session's gain model while it records answers
};

}  // namespace sightline
