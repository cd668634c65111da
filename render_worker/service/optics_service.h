// SPDX-License-Identifier: Apache-2.0
// OpticsService: jobs that choose camera and laser settings or compute tables of detectability.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "render_worker/optical_planning/plan_optics.h"
#include "render_worker/service/answer_jobs.h"
#include "render_worker/service/asset_store.h"
#include "rpc_server/call_tracker.h"
#include "sightline/v1/optics_service.grpc.pb.h"

namespace sightline {

class OpticsServiceImpl final : public v1::OpticsService::Service {
 public:
  struct Parts {
    std::string spool_folder;  // exists; for links to assets
    AssetStore* assets;
    JobStore* jobs;
    CallTracker* calls;
    int threads = 1;                              // of one job
    int64_t max_image_bytes = int64_t{8} << 30;   // memory for one image
    int64_t max_result_bytes = int64_t{1} << 28;  // answers in memory
  };
  explicit OpticsServiceImpl(Parts parts)
      : p_(std::move(parts)), answers_(p_.jobs, p_.spool_folder, p_.max_result_bytes) {}

  grpc::Status CreateOptics(grpc::ServerContext* context, const v1::CreateOpticsRequest* request,
                            v1::CreateOpticsResponse* response) override;
  grpc::Status GetOptics(grpc::ServerContext* context, const v1::GetOpticsRequest* request,
                         v1::GetOpticsResponse* response) override;
  grpc::Status CreateDetectability(grpc::ServerContext* context,
                                   const v1::CreateDetectabilityRequest* request,
                                   v1::CreateDetectabilityResponse* response) override;
  grpc::Status GetDetectability(grpc::ServerContext* context,
                                const v1::GetDetectabilityRequest* request,
                                v1::GetDetectabilityResponse* response) override;

 private:
  absl::Status Create(const std::string& peer, const v1::CreateOpticsRequest& request,
                      v1::CreateOpticsResponse* response);
  absl::Status CreateTable(const std::string& peer, const v1::CreateDetectabilityRequest& request,
                           v1::CreateDetectabilityResponse* response);

  const Parts p_;
  AnswerJobs answers_;
  std::atomic<int64_t> next_folder_ = 0;
};

}  // namespace sightline
