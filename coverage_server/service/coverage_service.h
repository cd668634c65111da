// SPDX-License-Identifier: Apache-2.0
// The gRPC service CoverageService: parts, scenes and queries of a SceneRegistry.
#pragma once

#include "coverage_server/service/coverage_backend.h"
#include "coverage_server/service/coverage_metrics.h"
#include "coverage_server/service/evaluation_pool.h"
#include "coverage_server/service/query_validation.h"
#include "coverage_server/service/scene_registry.h"
#include "rpc_server/call_tracker.h"
#include "rpc_server/peer_turns.h"
#include "rpc_server/rpc_server.h"
#include "rpc_server/upload.h"
#include "sightline/v1/coverage_service.grpc.pb.h"

namespace sightline {

class CoverageServiceImpl final : public v1::CoverageService::Service {
 public:
  struct Parts {
    CoverageBackend backend;
    SceneRegistry* registry;
    EvaluationPool* pool;
    CallTracker* calls;
    CoverageMetrics* metrics;
    int64_t max_part_file_bytes;
  };
  explicit CoverageServiceImpl(Parts parts)
      : p_(std::move(parts)), upload_memory_(2 * p_.max_part_file_bytes, p_.max_part_file_bytes) {}

  grpc::Status UploadPart(grpc::ServerContext* context,
                          grpc::ServerReader<v1::UploadPartRequest>* reader,
                          v1::UploadPartResponse* response) override;
  grpc::Status CreateScene(grpc::ServerContext* context, const v1::CreateSceneRequest* request,
                           v1::CreateSceneResponse* response) override;
  grpc::Status GetScene(grpc::ServerContext* context, const v1::GetSceneRequest* request,
                        v1::GetSceneResponse* response) override;
  grpc::Status StreamTargets(grpc::ServerContext* context, const v1::StreamTargetsRequest* request,
                             grpc::ServerWriter<v1::StreamTargetsResponse>* writer) override;
  grpc::Status EvaluateGains(grpc::ServerContext* context, const v1::EvaluateGainsRequest* request,
                             v1::EvaluateGainsResponse* response) override;
  grpc::Status StreamGains(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::StreamGainsResponse, v1::StreamGainsRequest>* stream) override;
  grpc::Status EvaluateUncertainty(
      grpc::ServerContext* context, const v1::EvaluateUncertaintyRequest* request,
      grpc::ServerWriter<v1::EvaluateUncertaintyResponse>* writer) override;
  grpc::Status EvaluateCoverage(grpc::ServerContext* context,
                                const v1::EvaluateCoverageRequest* request,
                                v1::EvaluateCoverageResponse* response) override;
  grpc::Status StreamMeasurementPoints(
      grpc::ServerContext* context, const v1::StreamMeasurementPointsRequest* request,
      grpc::ServerWriter<v1::StreamMeasurementPointsResponse>* writer) override;
  grpc::Status ExplainTargets(grpc::ServerContext* context,
                              const v1::ExplainTargetsRequest* request,
                              v1::ExplainTargetsResponse* response) override;
  grpc::Status RenderView(grpc::ServerContext* context, const v1::RenderViewRequest* request,
                          v1::RenderViewResponse* response) override;

 private:
  absl::Status ReceivePart(grpc::ServerContext* context,
                           grpc::ServerReader<v1::UploadPartRequest>* reader,
                           v1::UploadPartResponse* response);
  absl::Status Gains(grpc::ServerContext* context, const v1::EvaluateGainsRequest& request,
                     v1::EvaluateGainsResponse* response);
  // Gains of a request with uncertainty_gain, for the measurements of the batch within Table 2.1.
  absl::Status GainsByUncertainty(grpc::ServerContext* context, const CoverageScene& scene,
                                  const v1::EvaluateGainsRequest& request,
                                  const MeasurementBatch& batch, const TargetBits* covered,
                                  v1::EvaluateGainsResponse* response);
  absl::Status Uncertainty(grpc::ServerContext* context,
                           const v1::EvaluateUncertaintyRequest& request,
                           grpc::ServerWriter<v1::EvaluateUncertaintyResponse>* writer);
  absl::Status Coverage(grpc::ServerContext* context, const v1::EvaluateCoverageRequest& request,
                        v1::EvaluateCoverageResponse* response);
  absl::Status Explain(grpc::ServerContext* context, const v1::ExplainTargetsRequest& request,
                       v1::ExplainTargetsResponse* response);
  // Runs `body` on the pool; stops when the call ends.
  absl::Status Evaluate(grpc::ServerContext* context, size_t items, size_t chunk,
                        const EvaluationPool::Body& body);

  const Parts p_;
  const SharedLimit upload_memory_;  // bytes that have arrived and are not stored yet
  // Limits how many parts are read at a time: a mesh of 20 million triangles takes about 4 GB until
  // it is welded, and a small glTF file can repeat its geometry to that number.
  PeerTurns reading_turns_{2};
};

}  // namespace sightline
