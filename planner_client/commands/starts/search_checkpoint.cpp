// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/starts/search_checkpoint.h"

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/process/program_path.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/multi_start/start_file.h"
#include "planner_client/rpc_client/sha256.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Names all that the answers of the session's coverage servers depend on.
absl::StatusOr<std::string> FingerprintOfAnswers(const PlanningSession& session,
                                                 const std::string& inspection_file) {
  const auto inspection = ReadFile(inspection_file);
  if (!inspection.ok()) return inspection.status();
  // Another build may answer otherwise.
  std::error_code error;
  const auto built = fs::last_write_time(OwnProgram(), error).time_since_epoch().count();
  Sha256 fingerprint;
  fingerprint.Add(*inspection);
  fingerprint.Add(session.client->scene().scene_digest);
  if (session.fresh_client) fingerprint.Add(session.fresh_client->scene().scene_digest);
  if (session.robot) fingerprint.Add(session.robot->model().digest);
  fingerprint.Add(absl::StrCat(SIGHTLINE_VERSION, " ", built));
  return fingerprint.Hex();
}

// And what searches are asked for, whatever their seed.
std::string FingerprintOfResults(const std::string& answers, const PlannerRequest& request,
                                 int64_t bound_evaluations) {
  Sha256 fingerprint;
  fingerprint.Add(answers);
  fingerprint.Add(absl::StrCat(
      request.strategy, " ", NumberText(GoalFraction(request.goal)), " ", request.goal.max_scans,
      " ", NumberText(request.goal.max_time_s.value_or(0)), " ", request.evaluations_per_scan, " ",
      request.matrix_samples, " ", bound_evaluations));
  for (const std::vector<Measurement>* scans : {&request.locked, &request.starting}) {
    fingerprint.Add(absl::StrCat(" ", scans->size()));
    for (const Measurement& scan : *scans) {
      for (const double value : ToArray(scan)) fingerprint.Add(" " + NumberText(value));
    }
  }
  return fingerprint.Hex();
}

}  // namespace

absl::StatusOr<SearchCheckpoint> SearchCheckpoint::Open(const std::string& folder,
                                                        const PlanningSession& session,
                                                        const std::string& inspection_file,
                                                        const PlannerRequest& request,
                                                        int64_t bound_evaluations) {
  SearchCheckpoint checkpoint(folder);
  if (folder.empty()) return checkpoint;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return absl::InternalError(absl::StrCat(folder, ": ", error.message()));
  auto answers = FingerprintOfAnswers(session, inspection_file);
  if (!answers.ok()) return answers.status();
  checkpoint.answers_fingerprint_ = *std::move(answers);
  checkpoint.results_fingerprint_ =
      FingerprintOfResults(checkpoint.answers_fingerprint_, request, bound_evaluations);
  return checkpoint;
}

absl::Status SearchCheckpoint::KeepAnswers(const std::string& search, PlanningSession* session) {
  if (folder_.empty()) return absl::OkStatus();
  auto journal =
      JournalledOracle::Open(std::move(session->oracle), AnswersFile(search), answers_fingerprint_);
  if (!journal.ok()) return journal.status();
  journal_ = journal->get();
  session->oracle = *std::move(journal);
  return absl::OkStatus();
}

void SearchCheckpoint::LeaveAnswers(PlanningSession* session) {
  if (journal_ == nullptr) return;
  session->oracle = std::exchange(journal_, nullptr)->Release();
}

std::optional<StartResult> SearchCheckpoint::ResultOf(int64_t seed) const {
  if (folder_.empty()) return std::nullopt;
  return ReadStart(ResultFile(seed), results_fingerprint_, seed);
}

absl::Status SearchCheckpoint::KeepResult(const StartResult& start,
                                          const std::string& search) const {
  if (folder_.empty()) return absl::OkStatus();
  absl::Status written = WriteStart(start, results_fingerprint_, ResultFile(start.seed));
  if (!written.ok()) return written;
  std::error_code ignored;
  fs::remove(AnswersFile(search), ignored);
  return absl::OkStatus();
}

std::string SearchCheckpoint::AnswersFile(const std::string& search) const {
  return absl::StrCat(folder_, "/answers", search);
}

std::string SearchCheckpoint::ResultFile(int64_t seed) const {
  return absl::StrCat(folder_, "/start-", seed, ".json");
}

}  // namespace sightline
