// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/sensor_service.h"

#include <memory>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/recordings/load_images.h"
#include "core/sensor/emva1288_data.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/sensor_diagnosis/diagnose_sensor.h"
#include "render_worker/service/asset_folder.h"

namespace sightline {
namespace {

constexpr char kSensorJobKind[] = "sensor";

// Resources of one job.
struct SensorWork {
  explicit SensorWork(std::string folder) : assets(std::move(folder)) {}
  AssetFolder assets;
  v1::SensorSet set;
};

}  // namespace

absl::Status SensorServiceImpl::Create(const std::string& peer,
                                       const v1::CreateSensorDiagnosisRequest& request,
                                       v1::CreateSensorDiagnosisResponse* response) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto admission, answers_.Admit(kSensorJobKind, peer, request));
  if (admission.known) {
    *response->mutable_job() = *std::move(admission.known);
    return absl::OkStatus();
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckSensorSet(request.set(), "set"));
  auto work =
      std::make_shared<SensorWork>(absl::StrCat(p_.spool_folder, "/sensor-input-", next_folder_++));
  work->set = request.set();
  SIGHTLINE_RETURN_IF_ERROR(work->assets.Add(request.images(), "images", p_.assets));
  for (int i = 0; i < work->set.steps_size(); ++i) {
    for (const std::string& file : work->set.steps(i).files()) {
      if (work->assets.Has(file)) continue;
      return InvalidFields(
          {{"images", absl::StrCat("has no entry for ", file, ", set.steps[", i, "]")}});
    }
  }
  auto job = answers_.Create(
      kSensorJobKind, request, std::move(admission.room),
      [work](const AnswerJobs::Progress& progress,
             JobContext& context) -> absl::StatusOr<std::string> {
        SensorDiagnosisHooks hooks;
        hooks.read_image = [&](const std::string& file) -> absl::StatusOr<Image<uint16_t>> {
          SIGHTLINE_ASSIGN_OR_RETURN(const auto path, work->assets.Resolve(file));
          const auto check_size = [&](int columns_px, int rows_px) {
            if (columns_px == work->set.columns_px() && rows_px == work->set.rows_px()) {
              return absl::OkStatus();
            }
            return absl::InvalidArgumentError(absl::StrCat("is ", columns_px, " x ", rows_px,
                                                           " px, must be ", work->set.columns_px(),
                                                           " x ", work->set.rows_px(), " px"));
          };
          return LoadRawImage(path, work->set.bit_depth_bit(), check_size);
        };
        hooks.on_progress = [&](double fraction, std::string_view what) {
          progress(fraction, std::string(what));
        };
        hooks.cancelled = &context.cancelled();
        const auto answer = DiagnoseSensor(work->set, hooks);
        if (!answer.ok()) return work->assets.WithoutFolder(answer.status());
        return answer->SerializeAsString();
      });
  if (!job.ok()) return job.status();
  *response->mutable_job() = *std::move(job);
  return absl::OkStatus();
}

grpc::Status SensorServiceImpl::CreateSensorDiagnosis(
    grpc::ServerContext* context, const v1::CreateSensorDiagnosisRequest* request,
    v1::CreateSensorDiagnosisResponse* response) {
  return p_.calls->Run("CreateSensorDiagnosis", context,
                       [&] { return Create(PeerOf(*context), *request, response); });
}

grpc::Status SensorServiceImpl::GetSensorDiagnosis(grpc::ServerContext* context,
                                                   const v1::GetSensorDiagnosisRequest* request,
                                                   v1::GetSensorDiagnosisResponse* response) {
  return p_.calls->Run("GetSensorDiagnosis", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(const auto result,
                               answers_.Result(request->job_id(), kSensorJobKind));
    response->mutable_diagnosis()->ParseFromString(*result);
    return absl::OkStatus();
  });
}

}  // namespace sightline
