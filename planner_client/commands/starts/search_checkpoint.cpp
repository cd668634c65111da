// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/starts/search_checkpoint.h"

#include <cstdio>
#include <filesystem>
#include <span>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/process/program_build.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/print.h"
#include "planning/multi_start/start_file.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// A key of named pieces. Their lengths are included, so that different lists of pieces never have
// the same bytes.
class KeyOfPieces {
 public:
  void Add(std::string_view name, std::string_view value) {
    digest_.Update(absl::StrCat(std::string(name), " ", value.size(), "\n"));
    digest_.Update(value);
  }
  template <typename T>
  void AddAll(std::string_view name, std::span<const T> values) {
    static_assert(std::is_arithmetic_v<T>);
    Add(name, {reinterpret_cast<const char*>(values.data()), values.size_bytes()});
  }
  void AddScans(std::string_view name, const std::vector<Measurement>& scans) {
    std::vector<double> values;
    for (const Measurement& scan : scans) {
      const auto parameters = ToArray(scan);
      values.insert(values.end(), parameters.begin(), parameters.end());
    }
    AddAll<double>(name, values);
  }
  std::string Hex() { return digest_.Hex(); }

 private:
  Sha256 digest_;
};

// Names all that the answers of the session's gain model depend on.
std::string FingerprintOfAnswers(const PlanningSession& session, const SearchQuestion& question,
                                 const PlannerRequest& request) {
  KeyOfPieces key;
  key.Add("files", question.files.Digest());
  key.Add("options", question.options);
  key.Add("version", SIGHTLINE_VERSION);
  key.Add("program", ProgramBuild());
  for (const CoverageClient* client : {session.client.get(), session.validation_client.get()}) {
    if (client == nullptr) continue;
    key.Add("server", client->scene().server_build);
    key.Add("scene", client->scene().scene_digest);
    if (!session.requirements) continue;
    // Another program may have read the file of tolerances.
    const std::vector<float> admissible_m =
        session.requirements->AdmissibleUncertainties(client->targets());
    key.AddAll<float>("admissible", admissible_m);
  }
  if (session.robot) key.Add("robot", session.robot->model().digest);
  // Scans that stay are in the plan, reached by the robot or not.
  key.AddScans("locked", request.locked);
  return key.Hex();
}

// Names the request of searches apart from their seed.
std::string FingerprintOfResults(const std::string& answers, const PlannerRequest& request,
                                 int64_t bound_evaluations) {
  KeyOfPieces key;
  key.Add("answers", answers);
  key.Add("strategy", request.strategy);
  const double numbers[] = {GoalFraction(request.goal), request.goal.max_time_s.value_or(0)};
  key.AddAll<double>("goal", numbers);
  const int64_t counts[] = {request.goal.max_scans, request.evaluations_per_scan,
                            request.matrix_samples, bound_evaluations};
  key.AddAll<int64_t>("counts", counts);
  key.AddScans("starting", request.starting);
  return key.Hex();
}

void SayAboutCheckpoint(const std::string& remark) {
  PrintTextTo(stderr, "checkpoint: %s\n", remark.c_str());
}

}  // namespace

absl::StatusOr<SearchCheckpoint> SearchCheckpoint::Open(const std::string& folder,
                                                        const PlanningSession& session,
                                                        const SearchQuestion& question,
                                                        const PlannerRequest& request,
                                                        int64_t bound_evaluations) {
  SearchCheckpoint checkpoint;
  checkpoint.folder_ = folder;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return absl::InternalError(absl::StrCat(folder, ": ", error.message()));
  SIGHTLINE_RETURN_IF_ERROR(question.files.CheckUnchanged());
  checkpoint.answers_fingerprint_ = FingerprintOfAnswers(session, question, request);
  checkpoint.results_fingerprint_ =
      FingerprintOfResults(checkpoint.answers_fingerprint_, request, bound_evaluations);
  return checkpoint;
}

absl::Status SearchCheckpoint::KeepAnswers(const std::string& search, PlanningSession* session) {
  if (folder_.empty()) return absl::OkStatus();
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto journal, RecordReplayGainModel::Open(std::move(session->gain_model), AnswersFile(search),
                                                answers_fingerprint_, SayAboutCheckpoint));
  journal_ = journal.get();
  session->gain_model = std::move(journal);
  return absl::OkStatus();
}

void SearchCheckpoint::LeaveAnswers(PlanningSession* session) {
  if (journal_ == nullptr) return;
  session->gain_model = std::exchange(journal_, nullptr)->Release();
}

std::optional<StartResult> SearchCheckpoint::ResultOf(int64_t seed) const {
  if (folder_.empty()) return std::nullopt;
  std::string why;
  auto start = ReadStart(ResultFile(seed), results_fingerprint_, seed, &why);
  if (!why.empty()) {
    SayAboutCheckpoint(
        absl::StrCat(ResultFile(seed), ": ", why, "; the search with this seed is repeated"));
  }
  return start;
}

absl::Status SearchCheckpoint::KeepResult(const StartResult& start,
                                          const std::string& search) const {
  if (folder_.empty()) return absl::OkStatus();
  SIGHTLINE_RETURN_IF_ERROR(WriteStart(start, results_fingerprint_, ResultFile(start.seed)));
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
