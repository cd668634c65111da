// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/optics_service.h"

#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/detectability/detectability_table.h"
#include "render_worker/material/material.h"
#include "render_worker/render/part_inspection.h"
#include "render_worker/service/asset_folder.h"

namespace sightline {
namespace {

constexpr char kOpticsJobKind[] = "optics";
constexpr char kDetectabilityJobKind[] = "detectability";
constexpr int kMostPartMaterials = 64;

// Resources of one job with a task of its kind.
template <typename Task>
struct Work {
  explicit Work(std::string folder) : assets(std::move(folder)) {}
  AssetFolder assets;
  Inspection inspection;
  std::vector<ActiveEffect> effects;
  Task task;
};

// Reads the request's inspection with its effects.
template <typename Task>
absl::Status ReadInspection(const v1::Inspection& message, Work<Task>* work) {
  SIGHTLINE_ASSIGN_OR_RETURN(work->inspection, ParsePartInspection(message, "inspection"));
  SIGHTLINE_ASSIGN_OR_RETURN(work->effects, MakeEffects(work->inspection.effects));
  return absl::OkStatus();
}

// Puts the request's assets into the job's folder. INVALID_ARGUMENT names the first of `needed`
// that they lack.
template <typename Assets>
absl::Status AddAssets(const Assets& assets, const std::vector<std::string>& needed,
                       AssetStore* store, AssetFolder* folder) {
  SIGHTLINE_RETURN_IF_ERROR(folder->Add(assets, "assets", store));
  for (const std::string& file : needed) {
    if (folder->Has(file)) continue;
    return InvalidFields({{"assets", absl::StrCat("has no entry for ", file)}});
  }
  return absl::OkStatus();
}

// `Hooks`: OpticsHooks or DetectabilityHooks. They refer to `context`.
template <typename Hooks>
Hooks HooksOf(int threads, int64_t max_image_bytes, const AnswerJobs::Progress& progress,
              JobContext& context) {
  Hooks hooks;
  hooks.limits.threads = threads;
  hooks.limits.max_image_bytes = max_image_bytes;
  hooks.limits.cancelled = &context.cancelled();
  hooks.on_progress = progress;
  return hooks;
}

// Files of the inspection's materials.
std::vector<std::string> FilesOfMaterials(const Inspection& inspection) {
  std::vector<std::string> files;
  for (const MaterialChoice& choice : inspection.materials) {
    for (const std::string& file : MaterialFiles(choice.material)) files.push_back(file);
  }
  return files;
}

}  // namespace

grpc::Status OpticsServiceImpl::CreateOptics(grpc::ServerContext* context,
                                             const v1::CreateOpticsRequest* request,
                                             v1::CreateOpticsResponse* response) {
  return p_.calls->Run("CreateOptics", context,
                       [&] { return Create(PeerOf(*context), *request, response); });
}

absl::Status OpticsServiceImpl::Create(const std::string& peer,
                                       const v1::CreateOpticsRequest& request,
                                       v1::CreateOpticsResponse* response) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto admission, answers_.Admit(kOpticsJobKind, peer, request));
  if (admission.known) {
    *response->mutable_job() = *std::move(admission.known);
    return absl::OkStatus();
  }
  auto work = std::make_shared<Work<OpticsTask>>(
      absl::StrCat(p_.spool_folder, "/optics-input-", next_folder_++));
  SIGHTLINE_RETURN_IF_ERROR(ReadInspection(request.inspection(), work.get()));
  SIGHTLINE_ASSIGN_OR_RETURN(auto frames,
                             ParsePartFrames(request.frames(), work->inspection, "frames"));
  for (size_t i = 0; i < frames.size(); ++i) {
    const v1::PartFrame& asked = request.frames(static_cast<int>(i));
    PartFrameRequest frame = frames[i];
    frame.setting.reset();  // it is what is looked for
    work->task.frames.push_back({frame, asked.scan(), asked.frame()});
  }
  work->task.per_scan = request.per_scan();
  work->task.seed = request.has_seed() ? static_cast<uint64_t>(request.seed()) : 1;
  SIGHTLINE_RETURN_IF_ERROR(
      AddAssets(request.assets(), AssetFiles(work->inspection), p_.assets, &work->assets));
  auto job = answers_.Create(
      kOpticsJobKind, request, std::move(admission.room),
      [this, work](const AnswerJobs::Progress& progress,
                   JobContext& context) -> absl::StatusOr<std::string> {
        auto scene = LoadPartScene(
            work->inspection, [&](const std::string& file) { return work->assets.Resolve(file); },
            nullptr);
        if (!scene.ok()) return work->assets.WithoutFolder(scene.status());
        const auto hooks = HooksOf<OpticsHooks>(p_.threads, p_.max_image_bytes, progress, context);
        auto plan = PlanOptics(**scene, work->effects, work->task, hooks);
        if (!plan.ok()) return work->assets.WithoutFolder(plan.status());
        return plan->SerializeAsString();
      });
  if (!job.ok()) return job.status();
  *response->mutable_job() = *std::move(job);
  return absl::OkStatus();
}

grpc::Status OpticsServiceImpl::GetOptics(grpc::ServerContext* context,
                                          const v1::GetOpticsRequest* request,
                                          v1::GetOpticsResponse* response) {
  return p_.calls->Run("GetOptics", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto result,
                               answers_.Result(request->job_id(), kOpticsJobKind));
    response->mutable_optics()->ParseFromString(*result);
    return absl::OkStatus();
  });
}

grpc::Status OpticsServiceImpl::CreateDetectability(grpc::ServerContext* context,
                                                    const v1::CreateDetectabilityRequest* request,
                                                    v1::CreateDetectabilityResponse* response) {
  return p_.calls->Run("CreateDetectability", context,
                       [&] { return CreateTable(PeerOf(*context), *request, response); });
}

absl::Status OpticsServiceImpl::CreateTable(const std::string& peer,
                                            const v1::CreateDetectabilityRequest& request,
                                            v1::CreateDetectabilityResponse* response) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto admission, answers_.Admit(kDetectabilityJobKind, peer, request));
  if (admission.known) {
    *response->mutable_job() = *std::move(admission.known);
    return absl::OkStatus();
  }
  auto work = std::make_shared<Work<DetectabilityTask>>(
      absl::StrCat(p_.spool_folder, "/detectability-input-", next_folder_++));
  SIGHTLINE_RETURN_IF_ERROR(ReadInspection(request.inspection(), work.get()));
  if (request.part_materials().empty() || request.part_materials_size() > kMostPartMaterials) {
    return InvalidFields(
        {{"part_materials", absl::StrCat("has ", request.part_materials_size(),
                                         " names, must have 1 to ", kMostPartMaterials)}});
  }
  DetectabilityTask& task = work->task;
  task.part_materials.assign(request.part_materials().begin(), request.part_materials().end());
  // The widest permitted pupil is the brightest.
  task.f_number = request.inspection().optics().f_numbers().empty()
                      ? work->inspection.rig.lens->f_number
                      : work->inspection.optics->f_numbers.front();
  if (work->inspection.detectability) {
    task.min_detected_fraction = work->inspection.detectability->min_detected_fraction;
  }
  task.seed = request.has_seed() ? static_cast<uint64_t>(request.seed()) : 1;
  SIGHTLINE_RETURN_IF_ERROR(
      AddAssets(request.assets(), FilesOfMaterials(work->inspection), p_.assets, &work->assets));
  auto job = answers_.Create(
      kDetectabilityJobKind, request, std::move(admission.room),
      [this, work](const AnswerJobs::Progress& progress,
                   JobContext& context) -> absl::StatusOr<std::string> {
        const auto hooks =
            HooksOf<DetectabilityHooks>(p_.threads, p_.max_image_bytes, progress, context);
        auto table = MakeDetectabilityTable(
            work->inspection, work->effects,
            [&](const std::string& file) { return work->assets.Resolve(file); }, work->task, hooks);
        if (!table.ok()) return work->assets.WithoutFolder(table.status());
        return table->SerializeAsString();
      });
  if (!job.ok()) return job.status();
  *response->mutable_job() = *std::move(job);
  return absl::OkStatus();
}

grpc::Status OpticsServiceImpl::GetDetectability(grpc::ServerContext* context,
                                                 const v1::GetDetectabilityRequest* request,
                                                 v1::GetDetectabilityResponse* response) {
  return p_.calls->Run("GetDetectability", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto result,
                               answers_.Result(request->job_id(), kDetectabilityJobKind));
    response->mutable_table()->ParseFromString(*result);
    return absl::OkStatus();
  });
}

}  // namespace sightline
