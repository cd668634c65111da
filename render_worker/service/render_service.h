// SPDX-License-Identifier: Apache-2.0
// RenderService: assets, render jobs and their files.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "core/job/job_store.h"
#include "render_worker/render/render_task.h"
#include "render_worker/service/asset_store.h"
#include "render_worker/service/render_output_store.h"
#include "rpc_server/call_tracker.h"
#include "rpc_server/upload.h"
#include "sightline/v1/render_service.grpc.pb.h"

namespace sightline {

class RenderServiceImpl final : public v1::RenderService::Service {
 public:
  struct Parts {
    std::string spool_folder;  // exists; for the files of jobs
    AssetStore* assets;
    RenderOutputStore* outputs;
    JobStore* jobs;
    CallTracker* calls;
    int threads = 1;  // of one job
    int64_t max_asset_bytes = 0;
    int64_t max_image_bytes = 0;
  };
  explicit RenderServiceImpl(Parts parts)
      : p_(std::move(parts)), upload_memory_(2 * p_.max_asset_bytes, p_.max_asset_bytes) {}

  grpc::Status UploadAsset(grpc::ServerContext* context,
                           grpc::ServerReader<v1::UploadAssetRequest>* reader,
                           v1::UploadAssetResponse* response) override;
  grpc::Status CreateRender(grpc::ServerContext* context, const v1::CreateRenderRequest* request,
                            v1::CreateRenderResponse* response) override;
  grpc::Status StreamRenderFiles(
      grpc::ServerContext* context, const v1::StreamRenderFilesRequest* request,
      grpc::ServerWriter<v1::StreamRenderFilesResponse>* writer) override;
  grpc::Status GetRenderWorker(grpc::ServerContext* context,
                               const v1::GetRenderWorkerRequest* request,
                               v1::GetRenderWorkerResponse* response) override;

 private:
  absl::Status Receive(grpc::ServerContext* context,
                       grpc::ServerReader<v1::UploadAssetRequest>* reader,
                       v1::UploadAssetResponse* response);
  absl::Status Create(const std::string& peer, const v1::CreateRenderRequest& request,
                      v1::CreateRenderResponse* response);
  absl::Status Stream(grpc::ServerContext* context, const v1::StreamRenderFilesRequest& request,
                      grpc::ServerWriter<v1::StreamRenderFilesResponse>* writer);

  const Parts p_;
  const SharedLimit upload_memory_;  // received bytes that are not stored yet
  std::atomic<int64_t> next_folder_ = 0;
  // Guards the lookup of jobs by request_id until a folder for a new job is made.
  std::mutex create_mutex_;
};

}  // namespace sightline
