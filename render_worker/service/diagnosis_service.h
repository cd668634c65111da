// SPDX-License-Identifier: Apache-2.0
// DiagnosisService: jobs that compare sets of recordings with the model.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/admission/shared_limit.h"
#include "core/job/job_store.h"
#include "core/status/stop_check.h"
#include "render_worker/diagnosis/diagnose.h"
#include "render_worker/scene_diagnosis/diagnose_scene.h"
#include "render_worker/service/answer_jobs.h"
#include "render_worker/service/asset_store.h"
#include "render_worker/verification/verify.h"
#include "rpc_server/call_tracker.h"
#include "sightline/v1/diagnosis_service.grpc.pb.h"

namespace sightline {

// Functions that the service runs. Calls of a missing function return UNIMPLEMENTED.
struct RecordingFunctions {
  // Diagnose, Verify and DiagnoseScene.
  std::function<absl::StatusOr<v1::Diagnosis>(const RecordedSet&, const DiagnosisSettings&,
                                              const DiagnosisProgress&)>
      diagnose = nullptr;
  std::function<absl::StatusOr<v1::Verification>(const RecordedSet&, const VerificationSettings&,
                                                 const DiagnosisProgress&)>
      verify = nullptr;
  std::function<absl::StatusOr<v1::Diagnosis>(const RecordedScene&, const SceneDiagnosisSettings&,
                                              const SceneDiagnosisProgress&)>
      diagnose_scene = nullptr;
};

class DiagnosisServiceImpl final : public v1::DiagnosisService::Service {
 public:
  struct Parts {
    std::string spool_folder;  // exists; for links to assets
    AssetStore* assets;
    JobStore* jobs;
    CallTracker* calls;
    RecordingFunctions functions;
    int threads = 1;                             // of one job
    int64_t max_image_bytes = int64_t{8} << 30;  // memory for one image of a part
    int64_t max_set_bytes = int64_t{1} << 30;    // raw values in memory, of all waiting sets
    int64_t max_result_bytes = int64_t{1}
                               << 30;  // answers in memory; the least recently used go first
  };
  explicit DiagnosisServiceImpl(Parts parts)
      : p_(std::move(parts)),
        answers_(p_.jobs, p_.spool_folder, p_.max_result_bytes),
        set_bytes_(p_.max_set_bytes, p_.max_set_bytes) {}

  grpc::Status CreateDiagnosis(grpc::ServerContext* context,
                               const v1::CreateDiagnosisRequest* request,
                               v1::CreateDiagnosisResponse* response) override;
  grpc::Status GetDiagnosis(grpc::ServerContext* context, const v1::GetDiagnosisRequest* request,
                            v1::GetDiagnosisResponse* response) override;
  grpc::Status CreateVerification(grpc::ServerContext* context,
                                  const v1::CreateVerificationRequest* request,
                                  v1::CreateVerificationResponse* response) override;
  grpc::Status GetVerification(grpc::ServerContext* context,
                               const v1::GetVerificationRequest* request,
                               v1::GetVerificationResponse* response) override;

 private:
  struct CheckedSet;
  struct CheckedPlate;
  struct CheckedScene;

  // `missing`: treatment of values that a plate's description does not state.
  enum class Missing { kError, kAssume };
  absl::StatusOr<std::shared_ptr<CheckedSet>> Check(const v1::RecordedSetSource& source,
                                                    Missing missing, const StopCheck& stop);
  absl::StatusOr<std::shared_ptr<const CheckedPlate>> CheckPlate(
      const v1::RecordedSetSource& source, Missing missing, const StopCheck& stop);
  // Checks the scene, except for its meshes.
  absl::StatusOr<std::shared_ptr<CheckedScene>> CheckScene(
      const v1::CreateDiagnosisRequest& request, const StopCheck& stop);
  absl::StatusOr<v1::Diagnosis> RunScene(CheckedScene& work, SceneDiagnosisSettings settings,
                                         const DiagnosisProgress& progress,
                                         const std::atomic<bool>& cancelled);
  // Queues `work`: a function of DiagnosisProgress and the cancelled state that returns the answer,
  // to which the warnings are added.
  template <typename Request, typename Work>
  absl::StatusOr<v1::Job> CreateJob(std::unique_ptr<JobRoom> room, const std::string& kind,
                                    const Request& request, std::vector<std::string> warnings,
                                    Work work);
  absl::StatusOr<v1::Job> CreatePlateDiagnosis(std::unique_ptr<JobRoom> room,
                                               const v1::CreateDiagnosisRequest& request,
                                               const StopCheck& stop);
  absl::StatusOr<v1::Job> CreateSceneDiagnosis(std::unique_ptr<JobRoom> room,
                                               const v1::CreateDiagnosisRequest& request,
                                               const StopCheck& stop);
  absl::Status Diagnosis(const std::string& peer, const v1::CreateDiagnosisRequest& request,
                         v1::CreateDiagnosisResponse* response, const StopCheck& stop);
  absl::Status Verification(const std::string& peer, const v1::CreateVerificationRequest& request,
                            v1::CreateVerificationResponse* response, const StopCheck& stop);

  const Parts p_;
  AnswerJobs answers_;
  SharedLimit set_bytes_;  // of all callers
  std::atomic<int64_t> next_folder_ = 0;
};

}  // namespace sightline
