// Client of a render worker's DiagnosisService: images go up, the answer comes back.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/diagnosis_service.pb.h"

namespace sightline {

// `images`: one for every recording, `file` as it stands there; `assets`: of parts, the files of
// the inspection. Uploads what the worker does not know and waits for the job. UNAVAILABLE: the
// worker ended; the message says how. CANCELLED: interrupted; with `on_waiting_for_rest` a diagnosis
// whose verdict is "interrupted", if the worker had something by then. Other errors are the worker's.
// `request` has everything else but the request_id.
absl::StatusOr<v1::Diagnosis> DiagnoseRecordings(const WorkerClientOptions& options,
                                                 v1::CreateDiagnosisRequest request,
                                                 const std::vector<AssetFile>& images,
                                                 const std::vector<AssetFile>& assets = {});
absl::StatusOr<v1::Verification> VerifyRecordings(const WorkerClientOptions& options,
                                                  v1::CreateVerificationRequest request,
                                                  const std::vector<AssetFile>& images);

}  // namespace sightline
