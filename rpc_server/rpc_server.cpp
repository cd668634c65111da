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
#include <fstream>
#include <mutex>
#include <sstream>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

constexpr char kUnixPrefix[] = "unix:";

bool IsUnix(const std::string& address) { return absl::StartsWith(address, kUnixPrefix); }

absl::StatusOr<std::string> ReadPem(const std::string& option, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file || !absl::StrContains(text.str(), "-----BEGIN ")) {
    return absl::InvalidArgumentError(
        absl::StrCat(option, ": ", path, " is not a readable PEM file"));
  }
  return text.str();
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> MakeCredentials(
    const RpcServerOptions& options) {
  if (options.tls_certificate_file.empty() != options.tls_key_file.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together");
  }
  if (options.tls_certificate_file.empty()) {
    if (!options.tls_client_ca_file.empty()) {
      return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key");
    }
    return grpc::InsecureServerCredentials();
  }
  absl::StatusOr<std::string> certificate = ReadPem("--tls-cert", options.tls_certificate_file);
  if (!certificate.ok()) return certificate.status();
  absl::StatusOr<std::string> key = ReadPem("--tls-key", options.tls_key_file);
  if (!key.ok()) return key.status();
  grpc::SslServerCredentialsOptions ssl;
  ssl.pem_key_cert_pairs.push_back({*key, *certificate});
  if (!options.tls_client_ca_file.empty()) {
    absl::StatusOr<std::string> ca = ReadPem("--tls-client-ca", options.tls_client_ca_file);
    if (!ca.ok()) return ca.status();
    ssl.pem_root_certs = *ca;
    ssl.client_certificate_request = GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY;
  }
  return grpc::SslServerCredentials(ssl);
}

absl::Status CheckAddress(const std::string& listen) {
  if (IsUnix(listen)) {
    const std::string path = listen.substr(sizeof(kUnixPrefix) - 1);
    sockaddr_un address{};
    if (path.empty() || path.size() >= sizeof(address.sun_path)) {
      return absl::InvalidArgumentError(absl::StrCat("--listen ", listen,
                                                     ": the path of a unix socket must have 1 to ",
                                                     sizeof(address.sun_path) - 1, " bytes"));
    }
    // gRPC replaces a socket that is there; one that still answers belongs to somebody.
    address.sun_family = AF_UNIX;
    std::copy(path.begin(), path.end(), address.sun_path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool taken =
        fd >= 0 && connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
    if (fd >= 0) close(fd);
    if (taken) return absl::UnavailableError(absl::StrCat("--listen ", listen, ": already in use"));
    return absl::OkStatus();
  }
  const size_t colon = listen.rfind(':');
  int port = -1;
  if (colon == std::string::npos || colon == 0 ||
      !absl::SimpleAtoi(listen.substr(colon + 1), &port) || port < 0 || port > 65535) {
    return absl::InvalidArgumentError(
        absl::StrCat("--listen ", listen, ": must be unix:PATH or HOST:PORT"));
  }
  return absl::OkStatus();
}

}  // namespace

RpcServer::RpcServer(std::string name, ServerMetrics* metrics, CallTracker* calls, JobStore* jobs)
    : name_(std::move(name)),
      metrics_(metrics),
      calls_(calls),
      jobs_(jobs),
      job_service_(jobs, calls) {}

RpcServer::~RpcServer() { Drain(absl::ZeroDuration()); }

absl::Status RpcServer::Listen(const RpcServerOptions& options,
                               const std::vector<NamedService>& services) {
  if (absl::Status status = CheckAddress(options.listen); !status.ok()) return status;
  absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> credentials = MakeCredentials(options);
  if (!credentials.ok()) return credentials.status();
  if (options.metrics_port >= 0) {
    const std::string bind = absl::StrCat(options.metrics_host, ":", options.metrics_port);
    try {
      exposer_ = std::make_unique<prometheus::Exposer>(bind, /*num_threads=*/1);
    } catch (const std::exception& e) {
      return absl::UnavailableError(absl::StrCat("--metrics-port: cannot listen on ", bind));
    }
    exposer_->RegisterCollectable(metrics_->registry());
    const std::vector<int> ports = exposer_->GetListeningPorts();
    metrics_port_ = ports.empty() ? 0 : ports.front();
  }
  static std::once_flag plugins;
  std::call_once(plugins, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(options.listen, *credentials, &port);
  // Otherwise a second server on the same port silently takes a share of the calls.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
  builder.SetMaxSendMessageSize(kMaxMessageBytes);
  // How long an idle polling thread sleeps; Shutdown may have to wait for it (default: 10 s).
  builder.SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::CQ_TIMEOUT_MSEC, 100);
  grpc::ResourceQuota quota(name_);
  quota.SetMaxThreads(options.max_call_threads);
  builder.SetResourceQuota(quota);
  for (const NamedService& service : services) builder.RegisterService(service.service);
  builder.RegisterService(&job_service_);
  server_ = builder.BuildAndStart();
  if (server_ == nullptr || (port == 0 && !IsUnix(options.listen))) {
    return absl::UnavailableError(
        absl::StrCat("--listen ", options.listen,
                     ": cannot listen there (address in use, no permission, or a wrong key)"));
  }
  address_ = IsUnix(options.listen)
                 ? options.listen
                 : absl::StrCat(options.listen.substr(0, options.listen.rfind(':')), ":", port);
  auto* health = server_->GetHealthCheckService();
  health->SetServingStatus(true);
  for (const NamedService& service : services) health->SetServingStatus(service.name, true);
  health->SetServingStatus("sightline.v1.JobService", true);
  spdlog::info("event=listening address={} metrics_port={}", address_, metrics_port_);
  return absl::OkStatus();
}

bool RpcServer::Drain(absl::Duration grace) {
  if (server_ == nullptr) return true;
  spdlog::info("event=draining grace_s={:.1f}", absl::ToDoubleSeconds(grace));
  server_->GetHealthCheckService()->SetServingStatus(false);
  calls_->StartDraining();
  // What they would make is lost with this process.
  for (const JobRecord& job : jobs_->List("")) {
    if (!job.finished()) jobs_->Cancel(job.job_id).status().IgnoreError();
  }
  const bool finished = calls_->WaitUntilIdle(grace);
  calls_->CancelAll();
  // Idle streams, health watches, and calls that were just cancelled.
  server_->Shutdown(std::chrono::system_clock::now() +
                    std::chrono::milliseconds(finished ? 20 : 300));
  server_->Wait();
  server_.reset();
  spdlog::info("event=stopped all_calls_finished={}", finished);
  return finished;
}

}  // namespace sightline
