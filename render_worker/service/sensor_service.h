// SPDX-License-Identifier: Apache-2.0
// SensorService: jobs that diagnose flat-field and dark frames.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "render_worker/service/answer_jobs.h"
#include "render_worker/service/asset_store.h"
#include "rpc_server/call_tracker.h"
#include "sightline/v1/sensor_service.grpc.pb.h"

namespace sightline {

class SensorServiceImpl final : public v1::SensorService::Service {
 public:
  struct Parts {
    std::string spool_folder;  // exists; for links to assets
    AssetStore* assets;
    JobStore* jobs;
    CallTracker* calls;
    int64_t max_result_bytes = int64_t{1} << 28;  // answers in memory
  };
  explicit SensorServiceImpl(Parts parts)
      : p_(std::move(parts)), answers_(p_.jobs, p_.spool_folder, p_.max_result_bytes) {}

  grpc::Status CreateSensorDiagnosis(grpc::ServerContext* context,
                                     const v1::CreateSensorDiagnosisRequest* request,
                                     v1::CreateSensorDiagnosisResponse* response) override;
  grpc::Status GetSensorDiagnosis(grpc::ServerContext* context,
                                  const v1::GetSensorDiagnosisRequest* request,
                                  v1::GetSensorDiagnosisResponse* response) override;

 private:
  absl::Status Create(const std::string& peer, const v1::CreateSensorDiagnosisRequest& request,
                      v1::CreateSensorDiagnosisResponse* response);

  const Parts p_;
  AnswerJobs answers_;
  std::atomic<int64_t> next_folder_ = 0;
};

}  // namespace sightline
