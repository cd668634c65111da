// SPDX-License-Identifier: Apache-2.0
#include "planning_service/jobs/planning_jobs.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "core/trace/trace_context.h"
#include "planning_service/job_store/job_checks.h"
#include "planning_service/task/file_contents.h"
#include "planning_service/task/planning_task.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr size_t kMaxRequestIdBytes = 128;
constexpr int kDefaultPage = 100;
constexpr int kLargestPage = 1000;
constexpr int kLeastPriority = -100;
constexpr int kMostRecipes = 1000;
// A task is a text by people or programs; shot lists of a few thousand images fit.
constexpr size_t kMaxTaskBytes = 16 << 20;
constexpr int64_t kMaxTaskFileBytes = 16 << 20;
// Piece size for scanning a file's text [bytes].
constexpr int64_t kScannedPieceBytes = 1 << 20;
constexpr char kPlanResult[] = "plan.json";

google::protobuf::Timestamp ToTimestamp(absl::Time time) {
  google::protobuf::Timestamp timestamp;
  const int64_t nanoseconds = absl::ToUnixNanos(time);
  timestamp.set_seconds(absl::ToUnixSeconds(time));
  timestamp.set_nanos(static_cast<int32_t>(nanoseconds - 1000000000 * timestamp.seconds()));
  return timestamp;
}

v1::PlanningJob::State ToProtoState(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return v1::PlanningJob::QUEUED;
    case JobState::kRunning:
      return v1::PlanningJob::RUNNING;
    case JobState::kSucceeded:
      return v1::PlanningJob::SUCCEEDED;
    case JobState::kFailed:
      return v1::PlanningJob::FAILED;
    case JobState::kCancelled:
      return v1::PlanningJob::CANCELLED;
  }
  return v1::PlanningJob::UNSPECIFIED;
}

absl::StatusOr<JobState> FromProtoState(int state) {
  switch (state) {
    case v1::PlanningJob::QUEUED:
      return JobState::kQueued;
    case v1::PlanningJob::RUNNING:
      return JobState::kRunning;
    case v1::PlanningJob::SUCCEEDED:
      return JobState::kSucceeded;
    case v1::PlanningJob::FAILED:
      return JobState::kFailed;
    case v1::PlanningJob::CANCELLED:
      return JobState::kCancelled;
    default:
      return InvalidFields({{"states", absl::StrCat(state, " is no state of a job")}});
  }
}

absl::Status UnknownJob(const std::string& job_id) {
  return WithErrorInfo(
      absl::NotFoundError(absl::StrCat("no job \"", absl::CHexEscape(job_id.substr(0, 80)), "\"")),
      "JOB_UNKNOWN");
}

absl::Status NotFinished(const std::string& job_id) {
  return WithErrorInfo(absl::FailedPreconditionError(
                           absl::StrCat("job \"", job_id, "\" has not finished: watch it first")),
                       "JOB_NOT_FINISHED");
}

// Converts an error of the artefact store for clients, who must not see paths of the server.
absl::Status StoringFailed(const absl::Status& status) {
  if (status.ok() || absl::IsInvalidArgument(status)) return status;
  spdlog::error("event=storing_failed error={:?}", status.ToString());
  const absl::Status shown(status.code(), absl::IsResourceExhausted(status)
                                              ? "the disk of the service is full"
                                              : "the service could not store the file");
  const std::string reason = ErrorReason(status);
  return reason.empty() ? shown : WithErrorInfo(shown, reason);
}

absl::Status CheckId(const std::string& field, const std::string& id, bool may_be_empty) {
  if (id.empty() && !may_be_empty) return InvalidFields({{field, "is missing"}});
  if (id.size() > kMaxRequestIdBytes) {
    return InvalidFields(
        {{field, absl::StrCat("has ", id.size(), " bytes, at most ", kMaxRequestIdBytes)}});
  }
  for (const unsigned char c : id) {
    if (c < 0x20 || c == 0x7f) return InvalidFields({{field, "has a control character"}});
  }
  return absl::OkStatus();
}

absl::Status CheckPriority(const Client& client, int priority) {
  const int greatest = std::max(0, client.max_priority);
  if (priority >= kLeastPriority && priority <= greatest) return absl::OkStatus();
  return InvalidFields(
      {{"priority", absl::StrCat("is ", priority, ", must be in [", kLeastPriority, ", ", greatest,
                                 "] for the client ", client.name)}});
}

absl::StatusOr<v1::PlanningTask> ParseTask(const std::string& bytes) {
  v1::PlanningTask task;
  if (!task.ParseFromString(bytes)) return absl::DataLossError("a kept task cannot be read");
  return task;
}

}  // namespace

v1::PlanningJob PlanningJobToProto(const PlanningJob& job) {
  v1::PlanningJob message;
  message.set_job_id(job.job_id);
  message.set_kind(job.kind);
  message.set_state(ToProtoState(job.state));
  message.set_progress(job.progress);
  message.set_message(job.message);
  message.set_client(job.client);
  message.set_request_id(job.request_id);
  message.set_priority(job.priority);
  if (job.failure.code != absl::StatusCode::kOk) {
    message.mutable_failure()->set_code(absl::StatusCodeToString(job.failure.code));
    message.mutable_failure()->set_reason(job.failure.reason);
    message.mutable_failure()->set_message(job.failure.message);
  }
  for (const JobFile& file : job.results) {
    v1::JobFile* result = message.add_results();
    result->set_name(file.name);
    result->set_digest(file.digest);
    result->set_size_bytes(file.size_bytes);
  }
  message.set_attempts(job.attempts);
  if (job.created != absl::InfinitePast()) *message.mutable_created_at() = ToTimestamp(job.created);
  if (job.started != absl::InfinitePast()) *message.mutable_started_at() = ToTimestamp(job.started);
  if (job.finished != absl::InfinitePast()) {
    *message.mutable_finished_at() = ToTimestamp(job.finished);
  }
  message.set_revision(job.revision);
  if (job.jobs_ahead) {
    constexpr int64_t kMost = std::numeric_limits<int32_t>::max();
    message.set_jobs_ahead(static_cast<int32_t>(std::min(*job.jobs_ahead, kMost)));
  }
  return message;
}

FileUpload::FileUpload(PlanningJobStore* store, Client client,
                       std::unique_ptr<ArtefactWriter> writer, int64_t stored_bytes,
                       ArrivingBytes* arriving)
    : store_(store),
      client_(std::move(client)),
      writer_(std::move(writer)),
      stored_bytes_(stored_bytes),
      arriving_(arriving, client_.name) {}

absl::Status FileUpload::Write(const std::string& bytes) {
  const int64_t size = writer_->size_bytes() + static_cast<int64_t>(bytes.size());
  if (size > client_.max_upload_bytes) {
    return WithErrorInfo(absl::ResourceExhaustedError(absl::StrCat(
                             "a file may have at most ", client_.max_upload_bytes, " bytes")),
                         "UPLOAD_TOO_LARGE");
  }
  if (!over_quota_) {
    const int64_t arriving = arriving_.Add(static_cast<int64_t>(bytes.size()));
    if (stored_bytes_ + arriving > client_.quota.max_stored_bytes) {
      over_quota_ = true;
      arriving_.Release();
      writer_->DiscardBytes();
    }
  }
  return StoringFailed(writer_->Write(bytes));
}

absl::StatusOr<JobFile> FileUpload::Finish(const std::string& expected_digest) {
  JobFile file;
  file.size_bytes = writer_->size_bytes();
  absl::StatusOr<std::string> digest =
      over_quota_ ? writer_->Digest(expected_digest) : writer_->Commit(expected_digest);
  if (!digest.ok()) return StoringFailed(digest.status());
  file.digest = *std::move(digest);
  if (over_quota_) {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto held, store_->FindFile(client_.name, file.digest));
    if (!held) {
      return QuotaExceeded(absl::StrCat("max_stored_bytes of client ", client_.name),
                           stored_bytes_ + file.size_bytes, client_.quota.max_stored_bytes);
    }
  }
  // The store counts the file from now on, so it must not count as arriving any more.
  arriving_.Release();
  SIGHTLINE_RETURN_IF_ERROR(store_->AddUpload(client_.name, file, client_.quota));
  return file;
}

PlanningJobs::PlanningJobs(PlanningJobStore* store, ArtefactStore* artefacts)
    : store_(store), artefacts_(artefacts) {}

absl::StatusOr<FileUpload> PlanningJobs::Upload(const Client& client) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto counts, store_->Count(client.name));
  auto writer = artefacts_->NewFile();
  if (!writer.ok()) return StoringFailed(writer.status());
  return FileUpload(store_, client, *std::move(writer), counts.stored_bytes, &arriving_);
}

absl::Status PlanningJobs::Check(const Client& client, const v1::PlanningTask& task,
                                 std::vector<JobFile>* files) {
  if (!client.MayAsk(task.kind()) && !task.kind().empty()) {
    return WithErrorInfo(
        absl::PermissionDeniedError(absl::StrCat("the client ", client.name, " may ask for ",
                                                 absl::StrJoin(client.kinds, ", "), " only")),
        "KIND_NOT_ALLOWED");
  }
  if (task.ByteSizeLong() > kMaxTaskBytes) {
    return InvalidFields(
        {{"task", absl::StrCat("has ", task.ByteSizeLong(), " bytes, at most ", kMaxTaskBytes)}});
  }
  std::vector<std::string> names;
  for (size_t i = 0; i < files->size(); ++i) {
    JobFile& file = (*files)[i];
    SIGHTLINE_ASSIGN_OR_RETURN(const auto size, store_->FindFile(client.name, file.digest));
    if (!size || !artefacts_->Has(file.digest)) {
      return WithErrorInfo(
          absl::NotFoundError(absl::StrCat("files[", i, "]: no file of digest ",
                                           absl::CHexEscape(file.digest.substr(0, 64)),
                                           " was uploaded; upload it")),
          "FILE_UNKNOWN", {{"digest", file.digest.substr(0, 64)}});
    }
    file.size_bytes = *size;
    names.push_back(file.name);
  }
  absl::Status checked =
      CheckTask(task, names, [&](const std::string& name) -> absl::StatusOr<std::string> {
        const auto file = std::find_if(files->begin(), files->end(),
                                       [&](const JobFile& f) { return f.name == name; });
        if (file == files->end()) return absl::NotFoundError(absl::StrCat("no file ", name));
        if (file->size_bytes > kMaxTaskFileBytes) {
          return absl::InvalidArgumentError(absl::StrCat(name, ": has ", file->size_bytes,
                                                         " bytes, at most ", kMaxTaskFileBytes,
                                                         " for a description"));
        }
        return artefacts_->Read(file->digest, 0, file->size_bytes);
      });
  if (!checked.ok()) return checked;
  checked = CheckFileContents(task, names, [&](const std::string& name, const auto& take) {
    const auto file = std::find_if(files->begin(), files->end(),
                                   [&](const JobFile& f) { return f.name == name; });
    if (file == files->end()) return absl::NotFoundError(absl::StrCat("no file ", name));
    bool wanted = true;
    for (int64_t at = 0; at < file->size_bytes && wanted; at += kScannedPieceBytes) {
      SIGHTLINE_ASSIGN_OR_RETURN(const auto piece,
                                 artefacts_->Read(file->digest, at, kScannedPieceBytes));
      wanted = take(piece);
    }
    return absl::OkStatus();
  });
  if (!checked.ok() || task.plan_job_id().empty()) return checked;
  const auto plan = Result(client, task.plan_job_id(), kPlanResult);
  if (!plan.ok()) {
    return WithErrorInfo(
        absl::Status(plan.status().code(), absl::StrCat("plan_job_id: ", plan.status().message())),
        ErrorReason(plan.status()));
  }
  files->push_back({kPlanResult, plan->file.digest, plan->file.size_bytes});
  return absl::OkStatus();
}

absl::StatusOr<PlanningJob> PlanningJobs::Accept(const Client& client, NewPlanningJob job) {
  job.traceparent = CurrentTraceparent();
  absl::StatusOr<PlanningJob> made = store_->Create(job, client.quota);
  if (made.ok()) {
    spdlog::info("event=job_accepted job={} kind={} client=\"{}\" request_id={:?}", made->job_id,
                 made->kind, made->client, made->request_id);
  }
  return made;
}

absl::StatusOr<PlanningJob> PlanningJobs::Create(const Client& client,
                                                 const std::string& request_id,
                                                 const v1::PlanningTask& given,
                                                 std::vector<JobFile> files, int priority) {
  v1::PlanningTask task = given;
  NormaliseFileNames(&task);
  SIGHTLINE_RETURN_IF_ERROR(CheckId("request_id", request_id, true));
  SIGHTLINE_RETURN_IF_ERROR(CheckPriority(client, priority));
  SIGHTLINE_RETURN_IF_ERROR(Check(client, task, &files));
  NewPlanningJob job;
  job.client = client.name;
  job.kind = task.kind();
  job.request_id = request_id;
  job.fingerprint = TaskFingerprint(task, files);
  job.task = task.SerializeAsString();
  job.files = std::move(files);
  job.priority = priority;
  return Accept(client, std::move(job));
}

absl::StatusOr<PlanningJob> PlanningJobs::Get(const Client& client, const std::string& job_id) {
  absl::StatusOr<PlanningJob> job = store_->Get(job_id);
  if (absl::IsNotFound(job.status())) return UnknownJob(job_id);
  // A job of another client gets the same answer as a job that does not exist.
  if (job.ok() && job->client != client.name && !client.is_operator) return UnknownJob(job_id);
  return job;
}

absl::StatusOr<PlanningJobs::Page> PlanningJobs::List(const Client& client,
                                                      const v1::ListPlanningJobsRequest& request) {
  PlanningJobFilter filter;
  if (!request.all_clients()) {
    filter.client = client.name;
  } else if (!client.is_operator) {
    return WithErrorInfo(
        absl::PermissionDeniedError(absl::StrCat("the client ", client.name, " is no operator")),
        "NOT_AN_OPERATOR");
  }
  for (const int state : request.states()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto parsed, FromProtoState(state));
    filter.states.push_back(parsed);
  }
  for (const std::string& kind : request.kinds()) {
    if (std::find(TaskKinds().begin(), TaskKinds().end(), kind) == TaskKinds().end()) {
      return InvalidFields(
          {{"kinds", absl::StrCat("\"", absl::CHexEscape(kind.substr(0, 40)), "\" is none of ",
                                  absl::StrJoin(TaskKinds(), ", "))}});
    }
    filter.kinds.push_back(kind);
  }
  if (request.page_size() < 0 || request.page_size() > kLargestPage) {
    return InvalidFields({{"page_size", absl::StrCat("is ", request.page_size(),
                                                     ", must be in [0, ", kLargestPage, "]")}});
  }
  if (!request.page_token().empty()) {
    const auto sequence = ParseWhole(request.page_token());
    if (!sequence.ok() || *sequence <= 0) {
      return InvalidFields({{"page_token", "was not given by this service"}});
    }
    filter.before_sequence = *sequence;
  }
  const int size = request.page_size() == 0 ? kDefaultPage : request.page_size();
  filter.limit = size + 1;
  SIGHTLINE_ASSIGN_OR_RETURN(auto jobs, store_->List(filter));
  Page page{std::move(jobs), ""};
  if (static_cast<int>(page.jobs.size()) > size) {
    page.jobs.resize(static_cast<size_t>(size));
    page.next_page_token = absl::StrCat(page.jobs.back().sequence);
  }
  return page;
}

absl::StatusOr<PlanningJob> PlanningJobs::Cancel(const Client& client, const std::string& job_id) {
  SIGHTLINE_RETURN_IF_ERROR(Get(client, job_id).status());
  return store_->RequestCancel(job_id);
}

absl::StatusOr<PlanningJob> PlanningJobs::WaitForChange(const Client& client,
                                                        const std::string& job_id, int64_t revision,
                                                        absl::Duration timeout) {
  SIGHTLINE_RETURN_IF_ERROR(Get(client, job_id).status());
  return store_->WaitForChange(job_id, revision, timeout);
}

absl::StatusOr<std::vector<JobEvent>> PlanningJobs::WaitForEvents(const Client& client,
                                                                  const std::string& job_id,
                                                                  int64_t sequence,
                                                                  absl::Duration timeout) {
  constexpr int kMostAtOnce = 100;
  const absl::Time start = absl::Now();
  while (true) {
    // The revision is read first, so that any later event ends the wait.
    SIGHTLINE_ASSIGN_OR_RETURN(auto job, Get(client, job_id));
    auto events = store_->Events(sequence, job_id, kMostAtOnce);
    if (!events.ok() || !events->empty() || job.IsFinished()) return events;
    const absl::Duration left = timeout - (absl::Now() - start);
    if (left <= absl::ZeroDuration()) return events;
    SIGHTLINE_RETURN_IF_ERROR(store_->WaitForChange(job_id, job.revision, left).status());
  }
}

absl::StatusOr<bool> PlanningJobs::KnowsEvent(int64_t sequence) {
  SIGHTLINE_ASSIGN_OR_RETURN(const int64_t newest, store_->NewestEvent());
  if (sequence == 0 || sequence == newest) return true;
  return store_->HasEvent(sequence);
}

absl::StatusOr<OpenResult> PlanningJobs::Result(const Client& client, const std::string& job_id,
                                                const std::string& name) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto job, Get(client, job_id));
  if (!job.IsFinished()) return NotFinished(job_id);
  for (const JobFile& file : job.results) {
    if (file.name != name) continue;
    auto path = artefacts_->CheckedPath(file.digest);
    if (!path.ok()) {
      // Clients must not see the path, so only the log has it.
      spdlog::error("event=result_damaged job={} result={:?} error={:?}", job_id, name,
                    std::string(path.status().message()));
      return absl::DataLossError(absl::StrCat("the bytes of result ", file.name, " of job ", job_id,
                                              " are damaged or lost: a backup has them"));
    }
    return OpenResult{file, *std::move(path)};
  }
  std::vector<std::string> names;
  for (const JobFile& file : job.results) {
    if (names.size() < 20) names.push_back(file.name);
  }
  const std::string why = job.state == JobState::kSucceeded
                              ? absl::StrCat("it has ", absl::StrJoin(names, ", "),
                                             job.results.size() > names.size() ? ", ..." : "")
                              : "it did not succeed";
  return WithErrorInfo(
      absl::NotFoundError(absl::StrCat("job \"", job_id, "\" has no result \"",
                                       absl::CHexEscape(name.substr(0, 100)), "\": ", why)),
      "RESULT_UNKNOWN");
}

absl::StatusOr<std::string> PlanningJobs::PrepareRecipe(const Client& client,
                                                        const std::string& recipe_id,
                                                        const v1::PlanningTask& given,
                                                        std::vector<JobFile> files) {
  v1::PlanningTask task = given;
  NormaliseFileNames(&task);
  SIGHTLINE_RETURN_IF_ERROR(CheckId("recipe_id", recipe_id, false));
  SIGHTLINE_RETURN_IF_ERROR(Check(client, task, &files));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto count, store_->CountRecipes(client.name));
  if (count >= kMostRecipes && !store_->GetRecipe(client.name, recipe_id).ok()) {
    return WithErrorInfo(absl::ResourceExhaustedError(absl::StrCat(
                             "the client ", client.name, " has ", count, " recipes prepared")),
                         "QUOTA_EXCEEDED");
  }
  Recipe recipe;
  recipe.client = client.name;
  recipe.recipe_id = recipe_id;
  recipe.kind = task.kind();
  recipe.fingerprint = TaskFingerprint(task, files);
  recipe.task = task.SerializeAsString();
  recipe.files = std::move(files);
  SIGHTLINE_RETURN_IF_ERROR(store_->PutRecipe(recipe, client.quota));
  return recipe.fingerprint;
}

absl::Status PlanningJobs::UnprepareRecipe(const Client& client, const std::string& recipe_id) {
  SIGHTLINE_RETURN_IF_ERROR(CheckId("recipe_id", recipe_id, false));
  return store_->DeleteRecipe(client.name, recipe_id);
}

absl::StatusOr<PlanningJob> PlanningJobs::StartJob(const Client& client,
                                                   const std::string& request_id,
                                                   const std::string& recipe_id, int priority) {
  SIGHTLINE_RETURN_IF_ERROR(CheckId("request_id", request_id, true));
  SIGHTLINE_RETURN_IF_ERROR(CheckId("recipe_id", recipe_id, false));
  SIGHTLINE_RETURN_IF_ERROR(CheckPriority(client, priority));
  SIGHTLINE_ASSIGN_OR_RETURN(auto recipe, store_->GetRecipe(client.name, recipe_id));
  SIGHTLINE_RETURN_IF_ERROR(ParseTask(recipe.task).status());
  if (!client.MayAsk(recipe.kind)) {
    return WithErrorInfo(absl::PermissionDeniedError(absl::StrCat(
                             "the client ", client.name, " may not ask for ", recipe.kind)),
                         "KIND_NOT_ALLOWED");
  }
  NewPlanningJob job;
  job.client = client.name;
  job.kind = recipe.kind;
  job.request_id = request_id;
  job.fingerprint = recipe.fingerprint;
  job.task = recipe.task;
  job.files = recipe.files;
  job.priority = priority;
  return Accept(client, std::move(job));
}

absl::StatusOr<v1::GetVisionStateResponse> PlanningJobs::VisionState(const Client& client) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto counts, store_->Count(client.name));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto recipes, store_->CountRecipes(client.name));
  v1::GetVisionStateResponse response;
  response.set_queued_jobs(counts.queued);
  response.set_running_jobs(counts.running);
  using State = v1::GetVisionStateResponse;
  response.set_state(!artefacts_->HasRoom() ? State::ERROR
                     : counts.running > 0   ? State::SINGLE_EXECUTION
                     : recipes > 0          ? State::READY
                                            : State::INITIALIZED);
  return response;
}

}  // namespace sightline
