// SPDX-License-Identifier: Apache-2.0
#include "planning_service/server/planning_server.h"

#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/process_folder/process_folder.h"
#include "core/status/status_macros.h"
#include "planning_service/access/client_access.h"
#include "planning_service/artefact_store/artefact_store.h"
#include "planning_service/events/event_delivery.h"
#include "planning_service/execution/engine/cluster_engine.h"
#include "planning_service/execution/housekeeping.h"
#include "planning_service/execution/job_runner.h"
#include "planning_service/grpc_api/planning_service.h"
#include "planning_service/http_api/http_api.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/jobs/planning_jobs.h"
#include "planning_service/server/planning_metrics.h"
#include "planning_service/web/web_page.h"
#include "rpc_server/call_tracker.h"
#include "rpc_server/listen_address.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

// Largest gRPC request: a task of 16 MiB with its envelope. gRPC parses a message before any check,
// so this and the memory that all messages of a server share (rpc_server.cpp) are
// the limits of its bodies.
constexpr int kMostRequestBytes = 20 << 20;

absl::Status MakeFolder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error) fs::permissions(folder, fs::perms::owner_all, error);  // parts are secrets
  if (!error) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("--data ", folder, ": ", error.message()));
}

// A server that other machines reach needs TLS and a clients file or client CA; without these
// everybody would be an operator.
absl::Status CheckExposure(const PlanningServerOptions& options) {
  const bool has_tls = !options.rpc.tls_certificate_file.empty();
  const bool knows_clients =
      !options.clients_file.empty() || !options.rpc.tls_client_ca_file.empty();
  for (const auto& [option, address] :
       {std::pair("--listen", options.rpc.listen), std::pair("--http", options.http_listen)}) {
    if (address.empty() || IsUnixAddress(address)) continue;
    SIGHTLINE_ASSIGN_OR_RETURN(auto host, HostOfAddress(option, address));
    SIGHTLINE_ASSIGN_OR_RETURN(auto loopback, IsLoopbackHost(host));
    if (loopback || options.rpc.allow_plaintext) continue;
    if (!has_tls) {
      return absl::InvalidArgumentError(absl::StrCat(
          option, " ", address,
          ": other machines reach it in plain text; give --tls-cert and --tls-key, listen on "
          "127.0.0.1, or add --allow-plaintext on a network that you trust"));
    }
    if (!knows_clients) {
      return absl::InvalidArgumentError(absl::StrCat(
          option, " ", address,
          ": everybody who reaches it could see and cancel all jobs; give --clients or "
          "--tls-client-ca, or add --allow-plaintext on a network that you trust"));
    }
  }
  return absl::OkStatus();
}

// Every user of the machine can read a command line.
absl::Status CheckDatabase(const std::string& connection) {
  const bool uri = absl::StrContains(connection, "://");
  const size_t at = connection.find('@');
  const bool uri_password =
      uri && at != std::string::npos &&
      connection.substr(0, at).find(':', connection.find("://") + 3) != std::string::npos;
  if (!uri_password && !absl::StrContains(absl::AsciiStrToLower(connection), "password")) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "--database: a password does not belong on the command line; put it into a password file "
      "(~/.pgpass, or PGPASSFILE)");
}

absl::StatusOr<std::unique_ptr<ComputeEngine>> MakeEngine(const PlanningServerOptions& options) {
  if (options.runner == "local") return MakeLocalEngine();
  std::unique_ptr<BatchScheduler> scheduler;
  if (options.runner == "slurm") {
    scheduler = MakeSlurmScheduler(options.slurm);
  } else if (options.runner == "kubernetes") {
    KubernetesOptions kubernetes = options.kubernetes;
    if (kubernetes.image.empty() || kubernetes.volume_claim.empty()) {
      return absl::InvalidArgumentError(
          "--runner kubernetes needs --kubernetes-image and --kubernetes-volume-claim");
    }
    if (kubernetes.mount_path.empty()) {
      kubernetes.mount_path = fs::absolute(options.data_folder).lexically_normal().string();
    }
    scheduler = MakeKubernetesScheduler(std::move(kubernetes));
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("--runner ", options.runner, ": must be local, slurm or kubernetes"));
  }
  if (absl::Status s = scheduler->Check(); !s.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("--runner ", options.runner, ": ", s.message()));
  }
  return MakeClusterEngine(std::move(scheduler));
}

class PlanningServerImpl final : public PlanningServer {
 public:
  PlanningServerImpl() : calls_(&metrics_), rpc_("planning_service", &metrics_, &calls_, nullptr) {}
  ~PlanningServerImpl() override { Drain(absl::ZeroDuration()); }

  absl::Status Start(const PlanningServerOptions& options) {
    SIGHTLINE_RETURN_IF_ERROR(CheckExposure(options));
    SIGHTLINE_RETURN_IF_ERROR(CheckDatabase(options.database));
    SIGHTLINE_ASSIGN_OR_RETURN(engine_, MakeEngine(options));
    const std::string work_folder = options.data_folder + "/work";
    for (const std::string& folder : {options.data_folder, work_folder}) {
      SIGHTLINE_RETURN_IF_ERROR(MakeFolder(folder));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(
        store_, options.database.empty() ? OpenSqliteJobStore(options.data_folder + "/jobs.sqlite")
                                         : OpenPostgresJobStore(options.database));
    SIGHTLINE_ASSIGN_OR_RETURN(const bool restored, store_->BeginService());
    if (restored) {
      spdlog::warn(
          "event=database_moved hint=\"the database was restored, copied or made by an"
          " older version: event ids go on 2^32 higher\"");
    }
    metrics_.SetStore(store_.get());
    const std::string data_folder = fs::absolute(options.data_folder).string();
    SIGHTLINE_ASSIGN_OR_RETURN(
        artefacts_, ArtefactStore::Open(data_folder + "/artefacts", options.min_free_bytes));
    if (options.clients_file.empty()) {
      access_ = AllowEverybody();
    } else {
      SIGHTLINE_ASSIGN_OR_RETURN(access_, ReadClientAccess(options.clients_file));
    }
    // Requeues jobs that ran when an earlier server ended.
    SIGHTLINE_RETURN_IF_ERROR(store_->RequeueOrphans().status());
    jobs_ = std::make_unique<PlanningJobs>(store_.get(), artefacts_.get());
    service_ = std::make_unique<PlanningServiceImpl>(jobs_.get(), access_.get(), &calls_);
    SIGHTLINE_RETURN_IF_ERROR(StartEvents(options));
    SIGHTLINE_RETURN_IF_ERROR(StartHttp(options));
    RpcServerOptions rpc = options.rpc;
    rpc.max_request_bytes = kMostRequestBytes;
    SIGHTLINE_RETURN_IF_ERROR(rpc_.Listen(rpc, {{"sightline.v1.PlanningService", service_.get()}}));

    HousekeepingOptions housekeeping;
    housekeeping.keep_finished = options.keep_finished;
    housekeeping.work_folder = work_folder;
    housekeeping_ = std::make_unique<Housekeeping>(housekeeping, store_.get(), artefacts_.get());
    JobRunnerOptions runner;
    runner.program = options.program;
    runner.work_folder = fs::absolute(work_folder).string();
    runner.step_cache_folder = fs::absolute(options.data_folder + "/step_cache").string();
    runner.hidden_folders = {data_folder, TemporaryBase()};
    // Messages of the schedulers' tools name their configuration files, which are in HOME.
    if (const char* home = std::getenv("HOME")) runner.hidden_folders.push_back(home);
    runner.workers = options.workers;
    runner.parts = options.parts;
    runner.max_memory_bytes = options.max_job_memory_bytes;
    runner.max_time = options.max_job_time;
    runner_ = std::make_unique<JobRunner>(runner, store_.get(), artefacts_.get(), access_.get(),
                                          engine_.get());
    runner_->Start();
    return absl::OkStatus();
  }

  const std::string& address() const override { return rpc_.address(); }

  std::string http_url() const override {
    return http_ ? absl::StrCat(http_scheme_, http_->address()) : "";
  }

  bool Drain(absl::Duration grace) override {
    const bool finished = rpc_.Drain(grace);
    if (http_) http_->Stop();
    // Their jobs go on at the next start.
    runner_.reset();
    housekeeping_.reset();
    events_.reset();
    http_.reset();
    return finished;
  }

 private:
  absl::Status StartEvents(const PlanningServerOptions& options) {
    std::vector<std::unique_ptr<EventReceiver>> receivers;
    for (const MqttOptions& mqtt : options.mqtt) {
      SIGHTLINE_ASSIGN_OR_RETURN(auto receiver, MakeMqttReceiver(mqtt));
      receivers.push_back(std::move(receiver));
    }
    for (const WebhookOptions& webhook : options.webhooks) {
      SIGHTLINE_ASSIGN_OR_RETURN(auto receiver, MakeWebhookReceiver(webhook));
      receivers.push_back(std::move(receiver));
    }
    if (!receivers.empty()) {
      events_ = std::make_unique<EventDelivery>(store_.get(), std::move(receivers));
    }
    return absl::OkStatus();
  }

  absl::Status StartHttp(const PlanningServerOptions& options) {
    if (options.http_listen.empty()) return absl::OkStatus();
    HttpApiOptions http;
    http.listen = options.http_listen;
    http.tls_certificate_file = options.rpc.tls_certificate_file;
    http.tls_key_file = options.rpc.tls_key_file;
    http.tls_client_ca_file = options.rpc.tls_client_ca_file;
    http.max_request_bytes = options.max_request_bytes;
    http.allowed_hosts = options.http_hosts;
    for (WebPageFile& file : WebPage()) {
      http.web_files.push_back(
          {std::move(file.path), std::move(file.content_type), std::move(file.bytes)});
    }
    SIGHTLINE_ASSIGN_OR_RETURN(http_, HttpApi::Start(http, jobs_.get(), access_.get()));
    http_scheme_ = http.tls_certificate_file.empty() ? "http://" : "https://";
    return absl::OkStatus();
  }

  // Each member needs the ones before it; members are destroyed in reverse order.
  PlanningMetrics metrics_;
  CallTracker calls_;
  std::unique_ptr<PlanningJobStore> store_;
  std::unique_ptr<ArtefactStore> artefacts_;
  std::unique_ptr<ClientAccess> access_;
  std::unique_ptr<PlanningJobs> jobs_;
  std::unique_ptr<PlanningServiceImpl> service_;
  RpcServer rpc_;
  std::unique_ptr<EventDelivery> events_;
  std::unique_ptr<HttpApi> http_;
  std::string http_scheme_;
  std::unique_ptr<Housekeeping> housekeeping_;
  std::unique_ptr<ComputeEngine> engine_;
  std::unique_ptr<JobRunner> runner_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PlanningServer>> StartPlanningServer(
    const PlanningServerOptions& options) {
  auto server = std::make_unique<PlanningServerImpl>();
  SIGHTLINE_RETURN_IF_ERROR(server->Start(options));
  return server;
}

}  // namespace sightline
