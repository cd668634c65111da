// SPDX-License-Identifier: Apache-2.0
#include "planner_client/rpc_client/channel.h"

#include <grpcpp/support/client_interceptor.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/trace/trace_context.h"

namespace sightline {
namespace {

constexpr int kMaxMessageBytes = 64 << 20;

// Names the request of a call to servers.
class TraceInterceptor final : public grpc::experimental::Interceptor {
 public:
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA) &&
        !CurrentTraceparent().empty()) {
      methods->GetSendInitialMetadata()->emplace(kTraceparentKey, CurrentTraceparent());
    }
    methods->Proceed();
  }
};

class TraceInterceptorFactory final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  grpc::experimental::Interceptor* CreateClientInterceptor(
      grpc::experimental::ClientRpcInfo*) override {
    return new TraceInterceptor();  // gRPC owns it
  }
};

}  // namespace

std::shared_ptr<grpc::Channel> OpenChannel(const ServerAccess& access) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
  arguments.SetMaxSendMessageSize(kMaxMessageBytes);
  // A server that was restarted is found quickly.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 2000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // The socket of an embedded server ends with its process; a ping would only add a time limit.
  if (access.embedded == nullptr) {
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS,
                     static_cast<int>(absl::ToInt64Milliseconds(kPingInterval)));
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                     static_cast<int>(absl::ToInt64Milliseconds(kSilence)));
    arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  }
  // Retries are made by the client itself.
  arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
  std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials();
  if (!access.tls_root_certificates.empty()) {
    grpc::SslCredentialsOptions ssl;
    ssl.pem_root_certs = access.tls_root_certificates;
    ssl.pem_private_key = access.tls_key;
    ssl.pem_cert_chain = access.tls_certificate;
    credentials = grpc::SslCredentials(ssl);
    if (!access.tls_server_name.empty()) {
      arguments.SetSslTargetNameOverride(access.tls_server_name);
    }
  }
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(std::make_unique<TraceInterceptorFactory>());
  return grpc::experimental::CreateCustomChannelWithInterceptors(
      access.Address(), credentials, arguments, std::move(interceptors));
}

void SetTimeout(grpc::ClientContext* context, absl::Duration timeout) {
  context->set_deadline(std::chrono::system_clock::now() +
                        std::chrono::milliseconds(absl::ToInt64Milliseconds(timeout)));
}

std::string NewRequestId() {
  std::random_device device;
  std::string id;
  for (int i = 0; i < 4; ++i) absl::StrAppend(&id, absl::Hex(device(), absl::kZeroPad8));
  return id;
}

absl::Duration RetryPause(int attempt) {
  return absl::Milliseconds(50) * (1 << std::min(attempt, 4));
}

}  // namespace sightline
