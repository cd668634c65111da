// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/render_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/process_folder/process_folder.h"
#include "core/status/status_macros.h"
#include "render_worker/service/optics_service.h"
#include "render_worker/service/render_service.h"
#include "render_worker/service/sensor_service.h"

namespace sightline {
namespace {

int Threads(int asked) {
  return asked > 0 ? asked : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

JobLimits JobLimitsOf(const RenderServerOptions& options) {
  const auto share_of = [&](int64_t all) {
    return std::max<int64_t>(1,
                             static_cast<int64_t>(options.peer_share * static_cast<double>(all)));
  };
  return {.max_jobs = options.max_queued_jobs,
          .max_jobs_of_owner = share_of(options.max_queued_jobs),
          .max_bytes = options.max_queued_bytes,
          .max_bytes_of_owner = share_of(options.max_queued_bytes)};
}

// Calls a function periodically, in its own thread, until destruction.
class Sweeper {
 public:
  Sweeper(absl::Duration interval, std::function<void()> sweep)
      : thread_([this, interval, sweep = std::move(sweep)] {
          std::unique_lock lock(mutex_);
          while (!stop_.wait_for(lock, absl::ToChronoMilliseconds(interval),
                                 [this] { return stopping_; })) {
            sweep();
          }
        }) {}
  ~Sweeper() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    stop_.notify_all();
    thread_.join();
  }
  Sweeper(const Sweeper&) = delete;
  Sweeper& operator=(const Sweeper&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

// Ten sweeps within the time that things are kept, but rarely enough to cost an idle machine
// nothing.
absl::Duration SweepInterval(absl::Duration keep) {
  return std::clamp(keep / 10, absl::Milliseconds(50), absl::Minutes(1));
}

class RenderServerImpl final : public RenderServer {
 public:
  RenderServerImpl(const RenderServerOptions& options, RecordingFunctions functions,
                   ProcessFolder spool)
      : spool_(std::move(spool)),
        calls_(&metrics_),
        assets_(spool_.path(), options.max_asset_store_bytes),
        outputs_(options.max_output_bytes, options.keep),
        jobs_(MakeInMemoryJobStore(options.render_workers, JobLimitsOf(options))),
        service_({spool_.path(), &assets_, &outputs_, jobs_.get(), &calls_,
                  Threads(options.threads), options.max_asset_bytes, options.max_image_bytes}),
        diagnosis_service_({spool_.path(), &assets_, jobs_.get(), &calls_, std::move(functions),
                            Threads(options.threads), options.max_image_bytes,
                            options.max_set_bytes}),
        optics_service_({spool_.path(), &assets_, jobs_.get(), &calls_, Threads(options.threads),
                         options.max_image_bytes}),
        sensor_service_({spool_.path(), &assets_, jobs_.get(), &calls_}),
        server_("render_worker", &metrics_, &calls_, jobs_.get()),
        sweeper_(SweepInterval(options.keep), [this, keep = options.keep] {
          assets_.DropUnused(keep);
          outputs_.Trim();
        }) {}

  ~RenderServerImpl() override { Drain(absl::ZeroDuration()); }

  absl::Status Listen(const RenderServerOptions& options) {
    absl::Status status =
        server_.Listen(options, {{"sightline.v1.RenderService", &service_},
                                 {"sightline.v1.DiagnosisService", &diagnosis_service_},
                                 {"sightline.v1.OpticsService", &optics_service_},
                                 {"sightline.v1.SensorService", &sensor_service_}});
    if (status.ok()) {
      spdlog::info("event=serving threads={} spool={}", Threads(options.threads), spool_.path());
    }
    return status;
  }

  const std::string& address() const override { return server_.address(); }
  int metrics_port() const override { return server_.metrics_port(); }
  bool Drain(absl::Duration grace) override {
    const bool finished = server_.Drain(grace);
    // Jobs refer to the stores.
    jobs_.reset();
    return finished;
  }
  void Abandon() override { spool_.Remove(); }

 private:
  ProcessFolder spool_;
  ServerMetrics metrics_;
  CallTracker calls_;
  AssetStore assets_;
  RenderOutputStore outputs_;
  std::unique_ptr<JobStore> jobs_;
  RenderServiceImpl service_;
  DiagnosisServiceImpl diagnosis_service_;
  OpticsServiceImpl optics_service_;
  SensorServiceImpl sensor_service_;
  RpcServer server_;
  Sweeper sweeper_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<RenderServer>> RenderServer::Start(
    const RenderServerOptions& options, RecordingFunctions functions) {
  std::string base = options.spool_folder;
  if (base.empty()) base = TemporaryBase();
  absl::StatusOr<ProcessFolder> spool = ProcessFolder::Make(base, "render");
  if (!spool.ok()) {
    return absl::Status(spool.status().code(), absl::StrCat("--spool ", spool.status().message()));
  }
  auto server =
      std::make_unique<RenderServerImpl>(options, std::move(functions), *std::move(spool));
  SIGHTLINE_RETURN_IF_ERROR(server->Listen(options));
  return server;
}

}  // namespace sightline
