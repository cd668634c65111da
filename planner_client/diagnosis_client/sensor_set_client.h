// SPDX-License-Identifier: Apache-2.0
// Client of a render worker's SensorService: flat-field and dark frames go up, the answer comes
// back.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/sensor_service.pb.h"

namespace sightline {

// `images`: one for every file that `request.set` lists, with its name as it stands there. Uploads
// missing files to the worker and waits for the job. `request` has everything else but the
// request_id. UNAVAILABLE: the worker ended; the message says how. CANCELLED: interrupted.
// UNIMPLEMENTED: the worker is older. Other errors are the worker's.
absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensorSet(const WorkerClientOptions& options,
                                                      v1::CreateSensorDiagnosisRequest request,
                                                      const std::vector<AssetFile>& images);

}  // namespace sightline
