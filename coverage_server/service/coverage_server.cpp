// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/coverage_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <thread>

#include "core/status/status_macros.h"
#include "coverage_server/service/coverage_metrics.h"
#include "coverage_server/service/coverage_service.h"

namespace sightline {
namespace {

constexpr size_t kMaxWaitingBatches = 512;

class CoverageServerImpl final : public CoverageServer {
 public:
  CoverageServerImpl(const CoverageServerOptions& options, const CoverageBackend& backend)
      : calls_(&metrics_),
        jobs_(MakeInMemoryJobStore(
            options.scene_workers,
            {.max_jobs = kMaxUnfinishedScenes,
             .max_jobs_of_owner = std::max<int64_t>(
                 1, static_cast<int64_t>(options.peer_share * kMaxUnfinishedScenes))})),
        registry_(backend, jobs_.get(), &metrics_, options.max_part_store_bytes,
                  options.max_scene_bytes),
        pool_(options.threads > 0
                  ? options.threads
                  : std::max(1, static_cast<int>(std::thread::hardware_concurrency())),
              kMaxWaitingBatches),
        coverage_service_(
            {backend, &registry_, &pool_, &calls_, &metrics_, options.max_part_file_bytes}),
        server_("coverage_server", &metrics_, &calls_, jobs_.get()) {}

  ~CoverageServerImpl() override { Drain(absl::ZeroDuration()); }

  absl::Status Listen(const CoverageServerOptions& options) {
    absl::Status status =
        server_.Listen(options, {{"sightline.v1.CoverageService", &coverage_service_}});
    if (status.ok()) spdlog::info("event=serving threads={}", pool_.threads());
    return status;
  }

  const std::string& address() const override { return server_.address(); }
  int metrics_port() const override { return server_.metrics_port(); }
  bool Drain(absl::Duration grace) override {
    const bool finished = server_.Drain(grace);
    // Jobs refer to the registry.
    jobs_.reset();
    return finished;
  }

 private:
  CoverageMetrics metrics_;
  CallTracker calls_;
  std::unique_ptr<JobStore> jobs_;
  SceneRegistry registry_;
  EvaluationPool pool_;
  CoverageServiceImpl coverage_service_;
  RpcServer server_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CoverageServer>> CoverageServer::Start(
    const CoverageServerOptions& options, const CoverageBackend& backend) {
  auto server = std::make_unique<CoverageServerImpl>(options, backend);
  SIGHTLINE_RETURN_IF_ERROR(server->Listen(options));
  return server;
}

}  // namespace sightline
