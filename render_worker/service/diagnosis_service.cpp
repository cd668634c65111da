#include "render_worker/service/diagnosis_service.h"

#include <spdlog/spdlog.h>

#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/recordings/check_recordings.h"
#include "core/recordings/load_images.h"
#include "core/recordings/recordings.h"
#include "proto/status/rpc_status.h"
#include "render_worker/effects/effect.h"
#include "render_worker/image_file/image_file.h"
#include "render_worker/service/asset_folder.h"
#include "render_worker/service/reservation.h"
#include "rpc_server/job_service.h"
#include "rpc_server/rpc_server.h"

namespace sightline {
namespace {

constexpr char kDiagnose[] = "diagnose";
constexpr char kVerify[] = "verify";
constexpr int kMostRecordings = 10000;
constexpr int kMostEffects = 3;
constexpr int kDefaultEffects = 2;
constexpr absl::Duration kProgressInterval = absl::Milliseconds(50);
// Room for what goes around an answer in its message.
constexpr size_t kMostAnswerBytes = kMaxMessageBytes - (1 << 20);

absl::Status InvalidImages(const AssetFolder& files, const std::vector<std::string>& errors) {
  std::vector<FieldViolation> violations;
  for (const std::string& error : errors) {
    violations.push_back({"source.images", files.WithoutFolder(error)});
  }
  return InvalidFields(violations);
}

absl::Status CheckEffectIds(const v1::CreateDiagnosisRequest& request) {
  std::vector<FieldViolation> violations;
  for (int i = 0; i < request.excluded_effects_size(); ++i) {
    const auto effect = MakeActiveEffect(request.excluded_effects(i), {});
    if (effect.ok()) continue;
    violations.push_back(
        {absl::StrCat("excluded_effects[", i, "]"), std::string(effect.status().message())});
  }
  return InvalidFields(violations);
}

}  // namespace

// A set that can be looked at, with its share of the memory.
struct DiagnosisServiceImpl::CheckedSet {
  CheckedSet(std::atomic<int64_t>* counter, int64_t bytes) : memory(counter, bytes) {}
  Reservation memory;
  RecordedSet set;
  std::vector<std::string> warnings;
};

absl::StatusOr<std::shared_ptr<const DiagnosisServiceImpl::CheckedSet>> DiagnosisServiceImpl::Check(
    const v1::RecordedSetSource& source) {
  const v1::Recordings& message = source.recordings();
  if (message.recordings_size() > kMostRecordings) {
    return InvalidFields(
        {{"source.recordings.recordings",
          absl::StrCat("has ", message.recordings_size(), ", at most ", kMostRecordings)}});
  }
  absl::StatusOr<RecordingSet> description = ParseRecordings(message, "source.recordings");
  if (!description.ok()) return description.status();
  if (description->format_version != 1) {
    return InvalidFields(
        {{"source.recordings.format_version",
          absl::StrCat("is ", description->format_version,
                       " (images of a part), must be 1: laser lines on a flat plate")}});
  }
  AssetFolder files(absl::StrCat(p_.spool_folder, "/set-", next_folder_++));
  absl::Status status = files.Add(source.images(), "source.images", p_.assets);
  if (!status.ok()) return status;
  std::vector<FieldViolation> missing;
  std::vector<std::string> paths;
  int64_t bytes = 0;
  for (size_t i = 0; i < description->recordings.size(); ++i) {
    const RecordedImage& image = description->recordings[i];
    bytes +=
        int64_t{image.roi_columns_px} * image.roi_rows_px * static_cast<int64_t>(sizeof(uint16_t));
    const absl::StatusOr<std::string> path = files.Resolve(image.file);
    if (path.ok()) {
      paths.push_back(*path);
    } else if (absl::IsNotFound(path.status())) {
      missing.push_back({"source.images",
                         absl::StrCat("has no entry for ", image.file, ", recordings[", i, "]")});
    } else {
      return files.WithoutFolder(path.status());
    }
  }
  if (!missing.empty()) return InvalidFields(missing);
  if (static_cast<size_t>(files.size()) > paths.size()) {
    return InvalidFields({{"source.images", absl::StrCat("has ", files.size(), " entries for ",
                                                         paths.size(), " recordings")}});
  }
  if (bytes > p_.max_set_bytes) {
    return WithErrorInfo(
        absl::ResourceExhaustedError(absl::StrCat("the set's images have ", bytes,
                                                  " bytes; the server takes at most ",
                                                  p_.max_set_bytes, " (--max-set-bytes)")),
        "SET_TOO_LARGE",
        {{"needed_bytes", absl::StrCat(bytes)}, {"max_bytes", absl::StrCat(p_.max_set_bytes)}});
  }
  auto checked = std::make_shared<CheckedSet>(&set_bytes_, bytes);
  if (checked->memory.total() > p_.max_set_bytes) {
    return WithRetryDelay(
        WithErrorInfo(absl::UnavailableError("overloaded: too many sets wait"), "OVERLOADED"),
        absl::Seconds(1));
  }
  std::vector<std::string> errors;
  std::vector<Image<uint16_t>> images =
      LoadRecordedImages(*description, paths, ReadRawImage, &errors);
  if (!errors.empty()) return InvalidImages(files, errors);
  RecordingCheck check = CheckRecordings(*description, images);
  if (!check.errors.empty()) return InvalidImages(files, check.errors);
  checked->warnings = std::move(check.warnings);
  checked->set = MakeRecordedSet(*std::move(description), std::move(images));
  return checked;
}

absl::StatusOr<v1::Job> DiagnosisServiceImpl::CreateJob(
    const std::string& kind, const std::string& request_id, const std::string& fingerprint,
    std::function<absl::StatusOr<std::string>(const DiagnosisProgress&)> run) {
  absl::StatusOr<JobRecord> job = p_.jobs->Create(
      kind, request_id, fingerprint,
      [this, run = std::move(run)](JobContext& context) -> absl::StatusOr<std::string> {
        // Every report wakes all who watch.
        absl::Time reported = absl::InfinitePast();
        auto answer = run([&](double fraction, std::string_view what) {
          if (const absl::Time now = absl::Now(); now - reported >= kProgressInterval) {
            reported = now;
            context.ReportProgress(fraction, std::string(what));
          }
          return !context.cancelled();
        });
        if (!answer.ok()) return answer.status();
        if (answer->size() > kMostAnswerBytes) {
          return absl::ResourceExhaustedError(
              absl::StrCat("the answer has ", answer->size(), " bytes, at most ", kMostAnswerBytes,
                           " can be sent: give fewer or smaller recordings"));
        }
        const std::string key = Sha256Hex(*answer);
        const auto bytes = static_cast<int64_t>(answer->size());
        absl::Status kept =
            results_.Put(key, std::make_shared<const std::string>(*std::move(answer)), bytes);
        if (!kept.ok()) return kept;
        return key;
      });
  if (!job.ok()) return job.status();
  return JobToProto(*job);
}

absl::StatusOr<std::shared_ptr<const std::string>> DiagnosisServiceImpl::Result(
    const std::string& job_id, const std::string& kind) {
  const absl::StatusOr<JobRecord> job = p_.jobs->Get(job_id);
  const std::string name = absl::StrCat(kind, " job \"", absl::Utf8SafeCEscape(job_id), "\"");
  if (!job.ok() || job->kind != kind) {
    return WithErrorInfo(absl::NotFoundError("no " + name), "JOB_UNKNOWN");
  }
  if (!job->finished()) {
    return WithErrorInfo(
        absl::FailedPreconditionError(absl::StrCat(name, " has not finished: watch it first")),
        "JOB_NOT_FINISHED");
  }
  if (!job->error.ok()) return job->error;
  auto result = results_.Get(job->result_key);
  if (result == nullptr) {
    return WithErrorInfo(
        absl::NotFoundError(absl::StrCat("the answer of ", name, " is not kept any more")),
        "RESULT_DROPPED");
  }
  return result;
}

absl::Status DiagnosisServiceImpl::Diagnosis(const v1::CreateDiagnosisRequest& request,
                                             v1::CreateDiagnosisResponse* response) {
  if (!p_.functions.diagnose) return absl::UnimplementedError("this worker does not diagnose");
  DiagnosisSettings settings;
  settings.seed = request.has_seed() ? static_cast<uint64_t>(request.seed()) : 1;
  settings.threads = p_.threads;
  settings.max_effects = request.has_max_effects() ? request.max_effects() : kDefaultEffects;
  settings.excluded_effects = {request.excluded_effects().begin(),
                               request.excluded_effects().end()};
  if (settings.max_effects < 1 || settings.max_effects > kMostEffects) {
    return InvalidFields({{"max_effects", absl::StrCat("is ", settings.max_effects,
                                                       ", must be in [1, ", kMostEffects, "]")}});
  }
  if (absl::Status status = CheckEffectIds(request); !status.ok()) return status;
  auto checked = Check(request.source());
  if (!checked.ok()) return checked.status();
  v1::CreateDiagnosisRequest asked = request;
  asked.clear_request_id();
  auto job = CreateJob(kDiagnose, request.request_id(), MessageDigest(asked),
                       [this, settings, work = *std::move(checked)](
                           const DiagnosisProgress& progress) -> absl::StatusOr<std::string> {
                         auto answer = p_.functions.diagnose(work->set, settings, progress);
                         if (!answer.ok()) return answer.status();
                         for (const std::string& warning : work->warnings)
                           answer->add_warnings(warning);
                         return answer->SerializeAsString();
                       });
  if (!job.ok()) return job.status();
  *response->mutable_job() = *std::move(job);
  return absl::OkStatus();
}

absl::Status DiagnosisServiceImpl::Verification(const v1::CreateVerificationRequest& request,
                                                v1::CreateVerificationResponse* response) {
  if (!p_.functions.verify) return absl::UnimplementedError("this worker does not verify");
  VerificationSettings settings;
  settings.seed = request.has_seed() ? static_cast<uint64_t>(request.seed()) : 1;
  settings.threads = p_.threads;
  auto checked = Check(request.source());
  if (!checked.ok()) return checked.status();
  v1::CreateVerificationRequest asked = request;
  asked.clear_request_id();
  auto job = CreateJob(kVerify, request.request_id(), MessageDigest(asked),
                       [this, settings, work = *std::move(checked)](
                           const DiagnosisProgress& progress) -> absl::StatusOr<std::string> {
                         auto answer = p_.functions.verify(work->set, settings, progress);
                         if (!answer.ok()) return answer.status();
                         for (const std::string& warning : work->warnings)
                           answer->add_warnings(warning);
                         return answer->SerializeAsString();
                       });
  if (!job.ok()) return job.status();
  *response->mutable_job() = *std::move(job);
  return absl::OkStatus();
}

grpc::Status DiagnosisServiceImpl::CreateDiagnosis(grpc::ServerContext* context,
                                                   const v1::CreateDiagnosisRequest* request,
                                                   v1::CreateDiagnosisResponse* response) {
  return p_.calls->Run("CreateDiagnosis", context, [&] { return Diagnosis(*request, response); });
}

grpc::Status DiagnosisServiceImpl::GetDiagnosis(grpc::ServerContext* context,
                                                const v1::GetDiagnosisRequest* request,
                                                v1::GetDiagnosisResponse* response) {
  return p_.calls->Run("GetDiagnosis", context, [&]() -> absl::Status {
    const auto result = Result(request->job_id(), kDiagnose);
    if (!result.ok()) return result.status();
    response->mutable_diagnosis()->ParseFromString(**result);
    return absl::OkStatus();
  });
}

grpc::Status DiagnosisServiceImpl::CreateVerification(grpc::ServerContext* context,
                                                      const v1::CreateVerificationRequest* request,
                                                      v1::CreateVerificationResponse* response) {
  return p_.calls->Run("CreateVerification", context,
                       [&] { return Verification(*request, response); });
}

grpc::Status DiagnosisServiceImpl::GetVerification(grpc::ServerContext* context,
                                                   const v1::GetVerificationRequest* request,
                                                   v1::GetVerificationResponse* response) {
  return p_.calls->Run("GetVerification", context, [&]() -> absl::Status {
    const auto result = Result(request->job_id(), kVerify);
    if (!result.ok()) return result.status();
    response->mutable_verification()->ParseFromString(**result);
    return absl::OkStatus();
  });
}

}  // namespace sightline
