// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/rpc_server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <prometheus/exposer.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "rpc_server/listen_address.h"
#include "rpc_server/server_credentials.h"

namespace sightline {
namespace {

constexpr char kUnixPrefix[] = "unix:";

// Connections that do not become HTTP/2, or TLS, within this time are closed.
constexpr int kHandshakeTimeout_ms = 10000;
// The server notices a peer that vanished without closing within the sum of these two times.
constexpr int kKeepaliveTime_ms = 30000;
constexpr int kKeepaliveTimeout_ms = 20000;
// Clients ping a server that computes (planner_client/rpc_client/channel.h); one that pings more
// often than this is cut off.
constexpr int kLeastPingInterval_ms = 20000;
// Connections without calls are closed after this time; clients reconnect by themselves.
constexpr int kConnectionIdle_ms = 300000;
// Limit on the memory of messages in transfer, whose calls are not yet known. gRPC ends calls and
// connections above it.
constexpr size_t kMaxMessageMemoryBytes = size_t{1} << 30;

// INVALID_ARGUMENT: the path cannot name a socket. UNAVAILABLE: a server answers there.
absl::Status CheckUnixAddress(const std::string& listen) {
  const std::string path = listen.substr(sizeof(kUnixPrefix) - 1);
  sockaddr_un address{};
  if (path.empty() || path.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("--listen ", listen,
                                                   ": the path of a unix socket must have 1 to ",
                                                   sizeof(address.sun_path) - 1, " bytes"));
  }
  // gRPC replaces an existing socket; one that still answers belongs to another server.
  address.sun_family = AF_UNIX;
  std::copy(path.begin(), path.end(), address.sun_path);
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const bool taken =
      fd >= 0 && connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  if (fd >= 0) close(fd);
  if (taken) return absl::UnavailableError(absl::StrCat("--listen ", listen, ": already in use"));
  return absl::OkStatus();
}

// Plain text leaves this machine only if asked for.
absl::Status CheckAddress(const RpcServerOptions& options) {
  if (IsUnixAddress(options.listen)) return CheckUnixAddress(options.listen);
  SIGHTLINE_ASSIGN_OR_RETURN(const std::string host, HostOfAddress("--listen", options.listen));
  if (!options.tls_certificate_file.empty() || options.allow_plaintext) return absl::OkStatus();
  const absl::StatusOr<bool> is_loopback = IsLoopbackHost(host);
  if (!is_loopback.ok()) {
    return absl::UnavailableError(absl::StrCat(
        "--listen ", options.listen, ": cannot listen there: ", is_loopback.status().message()));
  }
  if (*is_loopback) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "--listen ", options.listen,
      ": other machines reach this address, and without TLS anybody on the network could use the "
      "server and read what is sent. Give --tls-cert and --tls-key (and --tls-client-ca to choose "
      "who may connect), listen on unix:PATH or 127.0.0.1:PORT, or add --allow-plaintext on a "
      "network that you trust"));
}

absl::Status CheckMetricsAddress(const RpcServerOptions& options) {
  if (options.metrics_port < 0 || options.allow_plaintext) return absl::OkStatus();
  SIGHTLINE_ASSIGN_OR_RETURN(const std::string host,
                             HostOfAddress("--metrics-host", absl::StrCat(options.metrics_host, ":",
                                                                          options.metrics_port)));
  const absl::StatusOr<bool> is_loopback = IsLoopbackHost(host);
  if (!is_loopback.ok()) {
    return absl::UnavailableError(
        absl::StrCat("--metrics-host ", options.metrics_host,
                     ": cannot listen there: ", is_loopback.status().message()));
  }
  if (*is_loopback) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "--metrics-host ", options.metrics_host,
      ": metrics are served without TLS to everybody who reaches this address. Leave it at "
      "127.0.0.1, or add --allow-plaintext on a network that you trust"));
}

// Refuses compressed messages: gRPC unpacks a whole message before it checks the unpacked size,
// and a gigabyte of zeros takes a megabyte on the wire. gRPC answers UNIMPLEMENTED to calls that
// announce compression. Without the announcement the message stays packed and cannot be parsed.
void RefuseCompression(grpc::ServerBuilder& builder) {
  for (int algorithm = GRPC_COMPRESS_NONE + 1; algorithm < GRPC_COMPRESS_ALGORITHMS_COUNT;
       ++algorithm) {
    builder.SetCompressionAlgorithmSupportStatus(static_cast<grpc_compression_algorithm>(algorithm),
                                                 false);
  }
  builder.AddChannelArgument(GRPC_ARG_ENABLE_PER_MESSAGE_DECOMPRESSION, 0);
}

// Streams wait for their clients, so half of the threads are reserved for unary calls.
CallLimits LimitsOf(const RpcServerOptions& options) {
  const auto share_of = [&](int all) {
    return std::max(1, static_cast<int>(options.peer_share * all));
  };
  CallLimits limits;
  limits.max_calls = options.max_call_threads;
  limits.max_calls_per_peer = share_of(limits.max_calls);
  limits.max_streams = options.max_call_threads / 2;
  limits.max_streams_per_peer = share_of(limits.max_streams);
  limits.idle_timeout = options.idle_timeout;
  return limits;
}

}  // namespace

RpcServer::RpcServer(std::string name, ServerMetrics* metrics, CallTracker* calls, JobStore* jobs)
    : name_(std::move(name)),
      metrics_(metrics),
      calls_(calls),
      jobs_(jobs),
      job_service_(jobs, calls) {}

RpcServer::~RpcServer() { RpcServer::Drain(absl::ZeroDuration()); }

absl::Status RpcServer::Listen(const RpcServerOptions& options,
                               const std::vector<NamedService>& services) {
  SIGHTLINE_RETURN_IF_ERROR(CheckAddress(options));
  SIGHTLINE_RETURN_IF_ERROR(CheckMetricsAddress(options));
  SIGHTLINE_ASSIGN_OR_RETURN(
      const std::shared_ptr<grpc::ServerCredentials> credentials,
      MakeServerCredentials(
          {options.tls_certificate_file, options.tls_key_file, options.tls_client_ca_file}));
  if (options.metrics_port >= 0) {
    const std::string bind = absl::StrCat(options.metrics_host, ":", options.metrics_port);
    try {
      exposer_ = std::make_unique<prometheus::Exposer>(bind, /*num_threads=*/1);
    } catch (const std::exception& e) {
      return absl::UnavailableError(absl::StrCat("--metrics-port: cannot listen on ", bind));
    }
    exposer_->RegisterCollectable(metrics_->collectable());
    const std::vector<int> ports = exposer_->GetListeningPorts();
    metrics_port_ = ports.empty() ? 0 : ports.front();
  }
  static std::once_flag plugins;
  std::call_once(plugins, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
  calls_->SetLimits(LimitsOf(options));
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(options.listen, credentials, &port);
  // With SO_REUSEPORT a second server on the same port would silently take some of the calls.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeTimeout_ms);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveTime_ms);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeout_ms);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                             kLeastPingInterval_ms);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, kConnectionIdle_ms);
  // Further calls of one connection wait at the client.
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, options.max_call_threads);
  RefuseCompression(builder);
  builder.SetMaxReceiveMessageSize(options.max_request_bytes);
  builder.SetMaxSendMessageSize(kMaxMessageBytes);
  // How long an idle polling thread sleeps; Shutdown may have to wait for it (default: 10 s).
  builder.SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::CQ_TIMEOUT_MSEC, 100);
  grpc::ResourceQuota quota(name_);
  quota.SetMaxThreads(options.max_call_threads);
  quota.Resize(kMaxMessageMemoryBytes);
  builder.SetResourceQuota(quota);
  for (const NamedService& service : services) builder.RegisterService(service.service);
  if (jobs_ != nullptr) builder.RegisterService(&job_service_);
  server_ = builder.BuildAndStart();
  if (server_ == nullptr || (port == 0 && !IsUnixAddress(options.listen))) {
    return absl::UnavailableError(absl::StrCat(
        "--listen ", options.listen, ": cannot listen there (address in use or no permission)"));
  }
  address_ = IsUnixAddress(options.listen)
                 ? options.listen
                 : absl::StrCat(options.listen.substr(0, options.listen.rfind(':')), ":", port);
  auto* health = server_->GetHealthCheckService();
  health->SetServingStatus(true);
  for (const NamedService& service : services) health->SetServingStatus(service.name, true);
  if (jobs_ != nullptr) health->SetServingStatus("sightline.v1.JobService", true);
  // Saturation changes the health of the services only: the server as a whole is alive, and must
  // not be restarted for being busy.
  std::vector<std::string> names;
  for (const NamedService& service : services) names.push_back(service.name);
  calls_->OnSaturation([health, names](bool saturated) {
    for (const std::string& name : names) health->SetServingStatus(name, !saturated);
  });
  spdlog::info("event=listening address={} metrics_port={}", address_, metrics_port_);
  return absl::OkStatus();
}

bool RpcServer::Drain(absl::Duration grace) {
  if (server_ == nullptr) return true;
  spdlog::info("event=draining grace_s={:.1f}", absl::ToDoubleSeconds(grace));
  calls_->StartDraining();
  calls_->OnSaturation(nullptr);
  server_->GetHealthCheckService()->SetServingStatus(false);
  // Running jobs are cancelled: their results would be lost with this process.
  if (jobs_ != nullptr) {
    for (const JobRecord& job : jobs_->List("")) {
      if (!job.finished()) jobs_->Cancel(job.job_id).status().IgnoreError();
    }
  }
  const bool finished = calls_->WaitUntilIdle(grace);
  calls_->CancelAll();
  // Time for idle streams, health watches and the calls cancelled above to end.
  server_->Shutdown(std::chrono::system_clock::now() +
                    std::chrono::milliseconds(finished ? 20 : 300));
  server_->Wait();
  server_.reset();
  spdlog::info("event=stopped all_calls_finished={}", finished);
  return finished;
}

}  // namespace sightline
