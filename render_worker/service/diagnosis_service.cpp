// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/diagnosis_service.h"

#include <algorithm>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/part/mesh.h"
#include "core/part/part_digest.h"
#include "core/recordings/assumed_values.h"
#include "core/recordings/check/check_recordings.h"
#include "core/recordings/load_images.h"
#include "core/recordings/part_inspection.h"
#include "core/recordings/recordings.h"
#include "core/recordings/reduction/reduce_posed_plates.h"
#include "core/recordings/reduction/start_from_images.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/effects/effect.h"
#include "render_worker/render/part_inspection.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/service/asset_folder.h"
#include "rpc_server/job_service.h"
#include "rpc_server/rpc_server.h"

namespace sightline {
namespace {

constexpr char kDiagnose[] = "diagnose";
constexpr char kVerify[] = "verify";
constexpr int kMostRecordings = 10000;
constexpr int kMostEffects = 3, kMostSceneEffects = 2;
constexpr int kDefaultEffects = 2;

absl::Status InvalidImages(const AssetFolder& files, const std::vector<std::string>& errors) {
  std::vector<FieldViolation> violations;
  for (const std::string& error : errors) {
    violations.push_back({"source.images", files.WithoutFolder(error)});
  }
  return InvalidFields(violations);
}

// `excluded_effects` against `check`, which gives the error of an id; `max_effects` in
// [1, most].
absl::Status CheckEffects(const v1::CreateDiagnosisRequest& request, int most,
                          const std::function<absl::Status(const std::string&)>& check) {
  std::vector<FieldViolation> violations;
  if (request.has_max_effects() && (request.max_effects() < 1 || request.max_effects() > most)) {
    violations.push_back({"max_effects", absl::StrCat("is ", request.max_effects(),
                                                      ", must be in [1, ", most, "]")});
  }
  for (int i = 0; i < request.excluded_effects_size(); ++i) {
    const absl::Status status = check(request.excluded_effects(i));
    if (status.ok()) continue;
    violations.push_back(
        {absl::StrCat("excluded_effects[", i, "]"), std::string(status.message())});
  }
  return InvalidFields(violations);
}

// Settings that parts and plates have in common.
template <typename Settings>
Settings CommonSettings(const v1::CreateDiagnosisRequest& request, int threads) {
  Settings settings;
  settings.seed = request.has_seed() ? static_cast<uint64_t>(request.seed()) : 1;
  settings.threads = threads;
  settings.max_effects = request.has_max_effects() ? request.max_effects() : kDefaultEffects;
  settings.excluded_effects = {request.excluded_effects().begin(),
                               request.excluded_effects().end()};
  return settings;
}

}  // namespace

// A checked set, with its share of the memory.
struct DiagnosisServiceImpl::CheckedSet {
  SharedLimit::Share memory;
  RecordingSet description;
  std::vector<Image<uint16_t>> images;
  std::vector<std::string> warnings;
};

struct DiagnosisServiceImpl::CheckedPlate {
  explicit CheckedPlate(const std::shared_ptr<CheckedSet>& checked)
      : source(checked),
        set(MakeRecordedSet(std::move(checked->description), std::move(checked->images))) {}
  const std::shared_ptr<CheckedSet> source;  // for its share of the memory, and the warnings
  const RecordedSet set;
};

// Recordings of a part with the files of its model.
struct DiagnosisServiceImpl::CheckedScene {
  CheckedScene(std::shared_ptr<CheckedSet> checked, std::string folder)
      : source(std::move(checked)), assets(std::move(folder)) {}
  const std::shared_ptr<CheckedSet> source;
  AssetFolder assets;
  RecordedScene scene;
};

absl::StatusOr<std::shared_ptr<DiagnosisServiceImpl::CheckedSet>> DiagnosisServiceImpl::Check(
    const v1::RecordedSetSource& source, Missing missing_values, const StopCheck& stop) {
  v1::Recordings message = source.recordings();
  if (message.recordings_size() > kMostRecordings) {
    return InvalidFields(
        {{"source.recordings.recordings",
          absl::StrCat("has ", message.recordings_size(), ", at most ", kMostRecordings)}});
  }
  std::vector<std::string> assumptions;
  if (missing_values == Missing::kAssume) assumptions = AssumeMissingValues(&message);
  SIGHTLINE_ASSIGN_OR_RETURN(RecordingSet description,
                             ParseRecordings(message, "source.recordings"));
  AssetFolder files(absl::StrCat(p_.spool_folder, "/set-", next_folder_++));
  SIGHTLINE_RETURN_IF_ERROR(files.Add(source.images(), "source.images", p_.assets));
  std::vector<FieldViolation> missing;
  std::vector<std::string> paths;
  int64_t bytes = 0;
  for (size_t i = 0; i < description.recordings.size(); ++i) {
    const RecordedImage& image = description.recordings[i];
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
  auto checked = std::make_shared<CheckedSet>();
  checked->memory = set_bytes_.Of("");
  if (checked->memory.Grow(bytes)) {
    return WithRetryDelay(
        WithErrorInfo(absl::UnavailableError("overloaded: too many sets wait"), "OVERLOADED"),
        absl::Seconds(1));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(LoadedImages loaded, LoadRecordedImages(description, paths, stop));
  if (!loaded.errors.empty()) return InvalidImages(files, loaded.errors);
  checked->images = std::move(loaded.raw_dn);
  assumptions.insert(assumptions.end(), loaded.remarks.begin(), loaded.remarks.end());
  if (loaded.eight_bit_files) {
    assumptions.push_back(
        TakeNarrowNumbers(EightBitNumbers(description.camera), &description, &checked->images));
  }
  if (description.posed) {
    const RecordingCheck whole = CheckRecordings(description, checked->images, stop);
    if (!whole.errors.empty()) return InvalidImages(files, whole.errors);
    SIGHTLINE_ASSIGN_OR_RETURN(auto reduced, ReducePosedPlates(description, checked->images));
    if (static_cast<int>(reduced.set.recordings.size()) > kMostRecordings) {
      return InvalidFields(
          {{"source.recordings.recordings",
            absl::StrCat("have ", reduced.set.recordings.size(), " segments of ", kSegmentPx,
                         " px along their lines, at most ", kMostRecordings)}});
    }
    description = std::move(reduced.set);
    checked->images = std::move(reduced.raw_dn);
    assumptions.insert(assumptions.end(), reduced.remarks.begin(), reduced.remarks.end());
    for (std::string& note : StartFromImages(checked->images, &description)) {
      assumptions.push_back(std::move(note));
    }
  }
  RecordingCheck check = CheckRecordings(description, checked->images, stop);
  if (check.narrow) {
    assumptions.push_back(TakeNarrowNumbers(*check.narrow, &description, &checked->images));
    check = CheckRecordings(description, checked->images, stop);
  }
  const std::vector<std::string> left_out =
      LeaveOutWithoutLine(check, &description, &checked->images);
  if (!left_out.empty()) check = CheckRecordings(description, checked->images, stop);
  SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
  if (!check.errors.empty()) return InvalidImages(files, check.errors);
  checked->warnings = assumptions;
  checked->warnings.insert(checked->warnings.end(), left_out.begin(), left_out.end());
  checked->warnings.insert(checked->warnings.end(), check.warnings.begin(), check.warnings.end());
  checked->description = std::move(description);
  return checked;
}

absl::StatusOr<std::shared_ptr<const DiagnosisServiceImpl::CheckedPlate>>
DiagnosisServiceImpl::CheckPlate(const v1::RecordedSetSource& source, Missing missing,
                                 const StopCheck& stop) {
  const int version = source.recordings().format_version();
  if (version == 2 || (version == 3 && missing == Missing::kError)) {
    return InvalidFields(
        {{"source.recordings.format_version",
          absl::StrCat("is ", version, version == 2 ? " (images of a part)" : " (plates in poses)",
                       ", must be 1: laser lines on a flat plate")}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto set, Check(source, missing, stop));
  return std::make_shared<const CheckedPlate>(set);
}

absl::StatusOr<std::shared_ptr<DiagnosisServiceImpl::CheckedScene>>
DiagnosisServiceImpl::CheckScene(const v1::CreateDiagnosisRequest& request, const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto set, Check(request.source(), Missing::kError, stop));
  auto work = std::make_shared<CheckedScene>(
      std::move(set), absl::StrCat(p_.spool_folder, "/scene-", next_folder_++));
  RecordedScene& scene = work->scene;
  absl::StatusOr<Inspection> inspection = absl::UnknownError("");
  if (request.has_inspection()) {
    inspection = ParsePartInspection(request.inspection(), "inspection");
  } else {
    SIGHTLINE_ASSIGN_OR_RETURN(
        const auto described,
        InspectionOfRecordings(request.source().recordings(), "source.recordings"));
    inspection = ParsePartInspection(described, "source.recordings.part");
  }
  if (!inspection.ok()) return inspection.status();
  scene.inspection = *std::move(inspection);
  if (!scene.inspection.effects.empty()) {
    return InvalidFields({{"inspection.effects", "is not empty: the null model has none"}});
  }
  SIGHTLINE_RETURN_IF_ERROR(work->assets.Add(request.assets(), "assets", p_.assets));
  for (const std::string& file : AssetFiles(scene.inspection)) {
    if (work->assets.Has(file)) continue;
    return InvalidFields({{"assets", absl::StrCat("has no entry for ", file)}});
  }
  scene.assets = [&assets = work->assets](const std::string& file) { return assets.Resolve(file); };
  scene.recordings = std::move(work->source->description);
  scene.raw_dn = std::move(work->source->images);
  return work;
}

absl::StatusOr<v1::Diagnosis> DiagnosisServiceImpl::RunScene(CheckedScene& work,
                                                             SceneDiagnosisSettings settings,
                                                             const DiagnosisProgress& progress,
                                                             const std::atomic<bool>& cancelled) {
  RecordedScene& scene = work.scene;
  const Inspection& inspection = scene.inspection;
  SIGHTLINE_ASSIGN_OR_RETURN(
      scene.part, LoadMeshAsset(inspection.part_file, inspection.part_unit, scene.assets));
  const std::string& stated = scene.recordings.part->part_digest;
  const PartDigest digest = PartDigestOf(scene.part);
  const absl::StatusOr<PartDigest> recorded = ParsePartDigest(stated);
  // Digests by an older rule cannot be compared: the part is taken.
  if (!stated.empty() &&
      (!recorded.ok() || Compare(*recorded, digest) == DigestComparison::kOtherPart)) {
    const auto size_mm = (1e3 * scene.part.BoundingBox().sizes()).eval();
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: is not the part of the recordings (part.part_digest): another file or another unit; "
        "it measures %.4g x %.4g x %.4g mm, its digest is %s, that of the recordings %s",
        inspection.part_file, size_mm.x(), size_mm.y(), size_mm.z(), digest.Text(), stated));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(scene.obstacles, LoadObstacles(inspection, scene.assets));
  settings.cancelled = &cancelled;
  return p_.functions.diagnose_scene(
      scene, settings,
      [&progress](double fraction, std::string_view what) { progress(fraction, what); });
}

template <typename Request, typename Work>
absl::StatusOr<v1::Job> DiagnosisServiceImpl::CreateJob(std::unique_ptr<JobRoom> room,
                                                        const std::string& kind,
                                                        const Request& request,
                                                        std::vector<std::string> warnings,
                                                        Work work) {
  return answers_.Create(kind, request, std::move(room),
                         [warnings = std::move(warnings), work = std::move(work)](
                             const AnswerJobs::Progress& progress,
                             JobContext& context) -> absl::StatusOr<std::string> {
                           SIGHTLINE_ASSIGN_OR_RETURN(
                               auto answer, work(
                                                [&](double fraction, std::string_view what) {
                                                  return progress(fraction, std::string(what));
                                                },
                                                context.cancelled()));
                           for (const std::string& warning : warnings) answer.add_warnings(warning);
                           return answer.SerializeAsString();
                         });
}

absl::StatusOr<v1::Job> DiagnosisServiceImpl::CreatePlateDiagnosis(
    std::unique_ptr<JobRoom> room, const v1::CreateDiagnosisRequest& request,
    const StopCheck& stop) {
  if (!p_.functions.diagnose) return absl::UnimplementedError("this worker does not diagnose");
  for (const auto& [given, name] : {std::pair(request.has_inspection(), "inspection"),
                                    std::pair(!request.assets().empty(), "assets")}) {
    if (given) return InvalidFields({{name, "is for parts; these recordings are of a plate"}});
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckEffects(request, kMostEffects, [](const std::string& id) {
    return MakeActiveEffect(id, {}).status();
  }));
  auto work = CheckPlate(request.source(), Missing::kAssume, stop);
  if (!work.ok()) return work.status();
  return CreateJob(std::move(room), kDiagnose, request, (*work)->source->warnings,
                   [this, settings = CommonSettings<DiagnosisSettings>(request, p_.threads),
                    work = *work](const DiagnosisProgress& progress, const std::atomic<bool>&) {
                     return p_.functions.diagnose(work->set, settings, progress);
                   });
}

absl::StatusOr<v1::Job> DiagnosisServiceImpl::CreateSceneDiagnosis(
    std::unique_ptr<JobRoom> room, const v1::CreateDiagnosisRequest& request,
    const StopCheck& stop) {
  if (!p_.functions.diagnose_scene) {
    return absl::UnimplementedError("this worker does not diagnose recordings of parts");
  }
  absl::Status status = CheckEffects(request, kMostSceneEffects, [](const std::string& id) {
    const std::vector<std::string>& known = LeftOutEffects();
    if (std::find(known.begin(), known.end(), id) != known.end()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "is \"", absl::Utf8SafeCEscape(id),
        "\", which is not considered for parts anyway; these are: ", absl::StrJoin(known, ", ")));
  });
  if (!status.ok()) return status;
  auto work = CheckScene(request, stop);
  if (!work.ok()) return work.status();
  auto settings = CommonSettings<SceneDiagnosisSettings>(request, p_.threads);
  settings.max_image_bytes = p_.max_image_bytes;
  return CreateJob(std::move(room), kDiagnose, request, (*work)->source->warnings,
                   [this, settings, work = *work](
                       const DiagnosisProgress& progress,
                       const std::atomic<bool>& cancelled) -> absl::StatusOr<v1::Diagnosis> {
                     auto answer = RunScene(*work, settings, progress, cancelled);
                     if (!answer.ok()) return work->assets.WithoutFolder(answer.status());
                     return answer;
                   });
}

absl::Status DiagnosisServiceImpl::Diagnosis(const std::string& peer,
                                             const v1::CreateDiagnosisRequest& request,
                                             v1::CreateDiagnosisResponse* response,
                                             const StopCheck& stop) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto admission, answers_.Admit(kDiagnose, peer, request));
  if (admission.known) {
    *response->mutable_job() = *std::move(admission.known);
    return absl::OkStatus();
  }
  SIGHTLINE_ASSIGN_OR_RETURN(*response->mutable_job(),
                             request.source().recordings().format_version() == 2
                                 ? CreateSceneDiagnosis(std::move(admission.room), request, stop)
                                 : CreatePlateDiagnosis(std::move(admission.room), request, stop));
  return absl::OkStatus();
}

absl::Status DiagnosisServiceImpl::Verification(const std::string& peer,
                                                const v1::CreateVerificationRequest& request,
                                                v1::CreateVerificationResponse* response,
                                                const StopCheck& stop) {
  if (!p_.functions.verify) return absl::UnimplementedError("this worker does not verify");
  SIGHTLINE_ASSIGN_OR_RETURN(auto admission, answers_.Admit(kVerify, peer, request));
  if (admission.known) {
    *response->mutable_job() = *std::move(admission.known);
    return absl::OkStatus();
  }
  VerificationSettings settings;
  settings.seed = request.has_seed() ? static_cast<uint64_t>(request.seed()) : 1;
  settings.threads = p_.threads;
  auto work = CheckPlate(request.source(), Missing::kError, stop);
  if (!work.ok()) return work.status();
  SIGHTLINE_ASSIGN_OR_RETURN(
      *response->mutable_job(),
      CreateJob(std::move(admission.room), kVerify, request, (*work)->source->warnings,
                [this, settings, work = *work](const DiagnosisProgress& progress,
                                               const std::atomic<bool>&) {
                  return p_.functions.verify(work->set, settings, progress);
                }));
  return absl::OkStatus();
}

grpc::Status DiagnosisServiceImpl::CreateDiagnosis(grpc::ServerContext* context,
                                                   const v1::CreateDiagnosisRequest* request,
                                                   v1::CreateDiagnosisResponse* response) {
  return p_.calls->Run("CreateDiagnosis", context, [&] {
    return Diagnosis(PeerOf(*context), *request, response,
                     [&] { return p_.calls->CheckStop(context); });
  });
}

grpc::Status DiagnosisServiceImpl::GetDiagnosis(grpc::ServerContext* context,
                                                const v1::GetDiagnosisRequest* request,
                                                v1::GetDiagnosisResponse* response) {
  return p_.calls->Run("GetDiagnosis", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto result, answers_.Result(request->job_id(), kDiagnose));
    response->mutable_diagnosis()->ParseFromString(*result);
    return absl::OkStatus();
  });
}

grpc::Status DiagnosisServiceImpl::CreateVerification(grpc::ServerContext* context,
                                                      const v1::CreateVerificationRequest* request,
                                                      v1::CreateVerificationResponse* response) {
  return p_.calls->Run("CreateVerification", context, [&] {
    return Verification(PeerOf(*context), *request, response,
                        [&] { return p_.calls->CheckStop(context); });
  });
}

grpc::Status DiagnosisServiceImpl::GetVerification(grpc::ServerContext* context,
                                                   const v1::GetVerificationRequest* request,
                                                   v1::GetVerificationResponse* response) {
  return p_.calls->Run("GetVerification", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto result, answers_.Result(request->job_id(), kVerify));
    response->mutable_verification()->ParseFromString(*result);
    return absl::OkStatus();
  });
}

}  // namespace sightline
