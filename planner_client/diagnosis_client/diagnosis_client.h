// SPDX-License-Identifier: Apache-2.0
// Client of a render worker's DiagnosisService: uploads images and fetches the answer.
#pragma once

#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/diagnosis_service.pb.h"

namespace sightline {

// `images`: one for every recording, `file` as in the request; `assets`: for parts, the files of
// the inspection. `request` is complete except for the request_id. Uploads missing files to the
// worker and waits for the job. With `on_waiting_for_rest`, an interrupted diagnosis with partial
// results is no error but has the verdict "interrupted"; the function is called when the wait for
// these results begins. UNAVAILABLE: the worker ended; the message says how. CANCELLED:
// interrupted. Other errors are the worker's.
absl::StatusOr<v1::Diagnosis> DiagnoseRecordings(
    const WorkerClientOptions& options, v1::CreateDiagnosisRequest request,
    const std::vector<AssetFile>& images, const std::vector<AssetFile>& assets = {},
    const std::function<void()>& on_waiting_for_rest = nullptr);
absl::StatusOr<v1::Verification> VerifyRecordings(const WorkerClientOptions& options,
                                                  v1::CreateVerificationRequest request,
                                                  const std::vector<AssetFile>& images);

}  // namespace sightline
