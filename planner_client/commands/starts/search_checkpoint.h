// SPDX-License-Identifier: Apache-2.0
// Checkpoint of `sightline plan --checkpoint`, so that the same command goes on after its process
// was ended.
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

// Inputs of a search that an open session no longer knows.
struct SearchQuestion {
  // The inspection with all that it refers to, and measured points; as they were before the session
  // was opened, so that no file can change unseen between its digest and its reading.
  FileContents files;
  // Options that are in no file and not in the request: "pose prior 5 mm, ...".
  std::string options;
};

// A folder with the coverage server's answers to interrupted searches, in `answers…`, and the
// results of finished ones, in `start-SEED.json`. Several processes may use it for
// different searches.
class SearchCheckpoint {
 public:
  // A folder for nothing: no answers are kept.
  SearchCheckpoint() = default;
  // Answers and results are kept under the content of all that they depend on: the question's
  // files, the scenes, what is admissible at every target, the robot, the scans that stay, the
  // programs of client and server; results also under the request, apart from its seed. Entries of
  // other content and damaged ones are named on stderr and made again. INTERNAL: the folder cannot
  // be made. ABORTED: a file has changed since its content was taken.
  static absl::StatusOr<SearchCheckpoint> Open(const std::string& folder,
                                               const PlanningSession& session,
                                               const SearchQuestion& question,
                                               const PlannerRequest& request,
                                               int64_t bound_evaluations);

  // From now on the session's gain model keeps its answers, and gives those that are kept of the
  // search of that name. INTERNAL: the file cannot be written.
  absl::Status KeepAnswers(const std::string& search, PlanningSession* session);
  // Restores the session's gain model from before KeepAnswers.
  void LeaveAnswers(PlanningSession* session);

  std::optional<StartResult> ResultOf(int64_t seed) const;
  // Removes the answers of the search, which are not needed any more.
  absl::Status KeepResult(const StartResult& start, const std::string& search) const;

 private:
  std::string AnswersFile(const std::string& search) const;
  std::string ResultFile(int64_t seed) const;

  std::string folder_;  // empty: nothing is kept
  std::string answers_fingerprint_, results_fingerprint_;
  RecordReplayGainModel* journal_ = nullptr;  // the session's gain model, if that keeps its answers
};

}  // namespace sightline
