// SPDX-License-Identifier: Apache-2.0
// Client of a render worker's SensorService: uploads flat-field and dark frames and fetches the
// answer.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/sensor_service.pb.h"

namespace sightline {

// `images`: one for every file that `request.set` lists, with the same name. Uploads missing files
// to the worker and waits for the job. `request` is complete except for the request_id.
// UNAVAILABLE: the worker ended; the message says how. CANCELLED: interrupted. UNIMPLEMENTED: the
// worker is older. Other errors are the worker's.
absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensorSet(const WorkerClientOptions& options,
                                                      v1::CreateSensorDiagnosisRequest request,
                                                      const std::vector<AssetFile>& images);

}  // namespace sightline
