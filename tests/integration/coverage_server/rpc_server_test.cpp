// SPDX-License-Identifier: Apache-2.0
// Real servers: TLS whose files are replaced, addresses that need it, and a server without jobs.
#include "rpc_server/rpc_server.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/file/atomic_write.h"
#include "proto/status/rpc_status.h"
#include "rpc_server/health_check.h"
#include "rpc_server/job_service.h"
#include "rpc_server/listen_address.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "tests/integration/coverage_server/service_fixture.h"
#include "tests/integration/test_certificates.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Names of the client that last called.
class PeerService final : public v1::JobService::Service {
 public:
  grpc::Status ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest*,
                        v1::ListJobsResponse*) override {
    const auto auth = context->auth_context();
    std::lock_guard lock(mutex_);
    names_.clear();
    if (!auth->IsPeerAuthenticated()) return grpc::Status::OK;
    for (const char* property : {"x509_common_name", "x509_subject_alternative_name"}) {
      for (const grpc::string_ref& name : auth->FindPropertyValues(property)) {
        names_.emplace_back(name.data(), name.size());
      }
    }
    return grpc::Status::OK;
  }
  std::vector<std::string> names() {
    std::lock_guard lock(mutex_);
    return names_;
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> names_;
};

class RunningRpcServer {
 public:
  explicit RunningRpcServer(bool with_jobs = true)
      : jobs_(with_jobs ? MakeInMemoryJobStore(1) : nullptr),
        server_("test", &metrics_, &calls_, jobs_.get()) {}
  RpcServer& server() { return server_; }

 private:
  ServerMetrics metrics_;
  CallTracker calls_{&metrics_};
  std::unique_ptr<JobStore> jobs_;
  RpcServer server_;
};

absl::Status TryToListen(const RpcServerOptions& options) {
  RunningRpcServer running;
  return running.server().Listen(options, {});
}

struct Answer {
  absl::Status status;
  std::string server_name;  // common name in the certificate of the server
};

Answer CallOver(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::ListJobsResponse response;
  Answer answer;
  answer.status = FromGrpcStatus(
      v1::JobService::NewStub(channel)->ListJobs(&context, v1::ListJobsRequest(), &response));
  if (answer.status.ok()) {
    for (const grpc::string_ref& name :
         context.auth_context()->FindPropertyValues("x509_common_name")) {
      answer.server_name = std::string(name.data(), name.size());
    }
  }
  return answer;
}

// A connection of its own.
std::shared_ptr<grpc::Channel> NewChannel(const std::string& address, const std::string& roots,
                                          const PemPair& own = {}) {
  grpc::SslCredentialsOptions ssl;
  ssl.pem_root_certs = roots;
  ssl.pem_cert_chain = own.certificate;
  ssl.pem_private_key = own.key;
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
  return grpc::CreateCustomChannel(address, grpc::SslCredentials(ssl), arguments);
}

class RpcServerTlsTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text) {
    const std::string path = folder_.path() + "/" + name;
    EXPECT_TRUE(WriteFileAtomically(path, text).ok());
    return path;
  }
  RpcServerOptions Options(const PemPair& pair, const std::string& client_ca = "") {
    RpcServerOptions options;
    options.listen = "127.0.0.1:0";
    options.tls_certificate_file = Write("server.pem", pair.certificate);
    options.tls_key_file = Write("server.key", pair.key);
    if (!client_ca.empty()) options.tls_client_ca_file = Write("ca.pem", client_ca);
    return options;
  }
  void Replace(const PemPair& pair) {
    Write("server.pem", pair.certificate);
    Write("server.key", pair.key);
  }

  TemporaryFolder folder_;
  const TestAuthority old_authority_{"old authority"};
  const TestAuthority new_authority_{"new authority"};
  const std::string both_roots_ = old_authority_.certificate() + new_authority_.certificate();
};

TEST_F(RpcServerTlsTest, HealthIsAskedByTls) {
  RunningRpcServer running;
  const PemPair own = old_authority_.Issue("server");
  const RpcServerOptions options = Options(own, old_authority_.certificate());
  ASSERT_TRUE(running.server().Listen(options, {}).ok());
  HealthCheckOptions check;
  check.address = running.server().address();
  EXPECT_TRUE(absl::IsUnavailable(CheckHealth(check))) << "without TLS";
  check.tls_certificate_file = options.tls_certificate_file;
  EXPECT_TRUE(absl::IsInvalidArgument(CheckHealth(check))) << "without a key";
  check.tls_key_file = options.tls_key_file;
  EXPECT_TRUE(CheckHealth(check).ok()) << CheckHealth(check);
  const PemPair stranger = new_authority_.Issue("stranger");
  check.tls_certificate_file = Write("stranger.pem", stranger.certificate);
  check.tls_key_file = Write("stranger.key", stranger.key);
  EXPECT_TRUE(absl::IsUnavailable(CheckHealth(check))) << "of an authority that it does not know";
}

TEST(HealthCheckTest, ServingOrNot) {
  RunningRpcServer running;
  RpcServerOptions options;
  options.listen = "127.0.0.1:0";
  ASSERT_TRUE(running.server().Listen(options, {}).ok());
  HealthCheckOptions check;
  check.address = running.server().address();
  EXPECT_TRUE(CheckHealth(check).ok()) << CheckHealth(check);
  const std::string flag = "--health-check=" + check.address;
  const char* asks[] = {"server", flag.c_str()};
  EXPECT_EQ(MaybeCheckHealth(2, asks), 0);
  const char* asks_otherwise[] = {"server", "--health-check", check.address.c_str()};
  EXPECT_EQ(MaybeCheckHealth(3, asks_otherwise), 0);
  const char* asks_wrongly[] = {"server", "--health-check"};
  EXPECT_EQ(MaybeCheckHealth(2, asks_wrongly), 2);
  const char* asks_nothing[] = {"server", "--health-checks", "--listen"};
  EXPECT_EQ(MaybeCheckHealth(3, asks_nothing), std::nullopt);

  running.server().Drain(absl::ZeroDuration());
  EXPECT_TRUE(absl::IsUnavailable(CheckHealth(check)));
  EXPECT_EQ(MaybeCheckHealth(2, asks), 1);
}

TEST_F(RpcServerTlsTest, NewConnectionsSeeTheNewCertificate) {
  RunningRpcServer running;
  ASSERT_TRUE(running.server().Listen(Options(old_authority_.Issue("first")), {}).ok());
  const std::string address = running.server().address();
  const auto open = NewChannel(address, old_authority_.certificate());
  const Answer before = CallOver(open);
  ASSERT_TRUE(before.status.ok()) << before.status;
  EXPECT_EQ(before.server_name, "first");

  Replace(new_authority_.Issue("second"));
  WaitUntil([&] { return CallOver(NewChannel(address, both_roots_)).server_name == "second"; });
  // A client that trusts the old authority alone gets no new connection, but keeps the one it has.
  EXPECT_FALSE(CallOver(NewChannel(address, old_authority_.certificate())).status.ok());
  const Answer after = CallOver(open);
  EXPECT_TRUE(after.status.ok()) << after.status;
  EXPECT_EQ(after.server_name, "first");
}

TEST_F(RpcServerTlsTest, ClientsNeedACertificateOfTheCurrentAuthority) {
  PeerService peers;
  RunningRpcServer running(/*with_jobs=*/false);
  const absl::Status listening =
      running.server().Listen(Options(old_authority_.Issue("first"), old_authority_.certificate()),
                              {{"sightline.v1.JobService", &peers}});
  ASSERT_TRUE(listening.ok()) << listening;
  const std::string address = running.server().address();
  const PemPair old_client = old_authority_.Issue("old client", "DNS:client.plant,IP:10.0.0.7");
  const PemPair new_client = new_authority_.Issue("new client");
  const auto allowed = [&](const PemPair& client) {
    return CallOver(NewChannel(address, both_roots_, client)).status.ok();
  };
  EXPECT_TRUE(allowed(old_client));
  EXPECT_THAT(peers.names(), ElementsAre("old client", "client.plant", "10.0.0.7"));
  EXPECT_FALSE(allowed(new_client));
  EXPECT_FALSE(allowed({}));

  Write("ca.pem", new_authority_.certificate());
  Replace(new_authority_.Issue("second"));
  WaitUntil([&] { return allowed(new_client); });
  EXPECT_FALSE(allowed(old_client));
  EXPECT_FALSE(allowed({}));
  EXPECT_EQ(CallOver(NewChannel(address, both_roots_, new_client)).server_name, "second");
}

TEST_F(RpcServerTlsTest, RecoversFromWrongFiles) {
  RunningRpcServer running;
  const PemPair first = old_authority_.Issue("first");
  ASSERT_TRUE(running.server().Listen(Options(first), {}).ok());
  const std::string address = running.server().address();
  ASSERT_TRUE(CallOver(NewChannel(address, both_roots_)).status.ok());
  // Half of a replacement: certificate and key do not belong together. It takes the server a while
  // to see it.
  const PemPair second = new_authority_.Issue("second");
  Write("server.pem", second.certificate);
  std::this_thread::sleep_for(std::chrono::seconds(4));
  Write("server.key", second.key);
  WaitUntil([&] { return CallOver(NewChannel(address, both_roots_)).server_name == "second"; });
}

TEST_F(RpcServerTlsTest, WrongFilesAreNamed) {
  const PemPair pair = old_authority_.Issue("first");
  const auto error_of = [](const RpcServerOptions& options) {
    const absl::Status status = TryToListen(options);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    return std::string(status.message());
  };
  RpcServerOptions options = Options(pair);
  options.tls_certificate_file = "/nonexistent.pem";
  EXPECT_EQ(error_of(options), "--tls-cert: /nonexistent.pem is not a readable PEM file");
  options = Options(pair);
  options.tls_key_file = Write("empty", "");
  EXPECT_EQ(error_of(options),
            "--tls-key: " + options.tls_key_file + " is not a readable PEM file");
  options = Options(pair);
  options.tls_key_file = options.tls_certificate_file;
  EXPECT_THAT(error_of(options), HasSubstr("holds no private key"));
  options = Options(pair);
  options.tls_key_file = Write("other.key", new_authority_.Issue("other").key);
  EXPECT_THAT(error_of(options), HasSubstr("is not the key of the certificate in"));
  options = Options(pair);
  options.tls_certificate_file = Write("broken.pem", "-----BEGIN CERTIFICATE-----\nAAAA\n");
  EXPECT_THAT(error_of(options), HasSubstr("holds no certificate"));
  options = Options(pair);
  options.tls_client_ca_file = options.tls_key_file;
  EXPECT_THAT(error_of(options), HasSubstr("--tls-client-ca"));
  options = Options(pair);
  options.tls_key_file.clear();
  EXPECT_EQ(error_of(options), "--tls-cert and --tls-key belong together");
  options = {};
  options.listen = "127.0.0.1:0";
  options.tls_client_ca_file = Write("ca.pem", old_authority_.certificate());
  EXPECT_EQ(error_of(options), "--tls-client-ca needs --tls-cert and --tls-key");
}

TEST_F(RpcServerTlsTest, PlainTextNeedsToBeAllowedWhereOthersReachIt) {
  for (const char* listen : {"127.0.0.1:0", "localhost:0", "127.1.2.3:0"}) {
    RpcServerOptions options;
    options.listen = listen;
    const absl::Status status = TryToListen(options);
    EXPECT_TRUE(status.ok()) << status;
  }
  for (const char* listen : {"0.0.0.0:0", "[::]:0", "192.0.2.1:0", "[fe80::1]:0"}) {
    RpcServerOptions options;
    options.listen = listen;
    const absl::Status status = TryToListen(options);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_THAT(std::string(status.message()),
                AllOf(HasSubstr(listen), HasSubstr("--tls-cert"), HasSubstr("--allow-plaintext")));
  }
  RpcServerOptions allowed;
  allowed.listen = "0.0.0.0:0";
  allowed.allow_plaintext = true;
  EXPECT_TRUE(TryToListen(allowed).ok());
  RpcServerOptions encrypted = Options(old_authority_.Issue("first"));
  encrypted.listen = "0.0.0.0:0";
  EXPECT_TRUE(TryToListen(encrypted).ok());
  // Metrics have no TLS.
  encrypted.metrics_port = 0;
  EXPECT_TRUE(TryToListen(encrypted).ok());
  encrypted.metrics_host = "0.0.0.0";
  const absl::Status metrics = TryToListen(encrypted);
  EXPECT_EQ(metrics.code(), absl::StatusCode::kInvalidArgument) << metrics;
  EXPECT_THAT(std::string(metrics.message()),
              AllOf(HasSubstr("--metrics-host 0.0.0.0"), HasSubstr("--allow-plaintext")));
  encrypted.allow_plaintext = true;
  EXPECT_TRUE(TryToListen(encrypted).ok());
  // Nobody listens for metrics that are off.
  encrypted.allow_plaintext = false;
  encrypted.metrics_port = -1;
  EXPECT_TRUE(TryToListen(encrypted).ok());
}

TEST(ListenAddressTest, KnowsWhatStaysOnTheMachine) {
  for (const char* host : {"127.0.0.1", "127.255.0.1", "localhost", "::1", "::ffff:127.0.0.1"}) {
    const auto is_loopback = IsLoopbackHost(host);
    ASSERT_TRUE(is_loopback.ok()) << is_loopback.status();
    EXPECT_TRUE(*is_loopback) << host;
  }
  for (const char* host : {"0.0.0.0", "::", "10.0.0.1", "128.0.0.1", "::ffff:10.0.0.1"}) {
    const auto is_loopback = IsLoopbackHost(host);
    ASSERT_TRUE(is_loopback.ok()) << is_loopback.status();
    EXPECT_FALSE(*is_loopback) << host;
  }
  EXPECT_EQ(IsLoopbackHost("nobody.invalid").status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(*HostOfAddress("--http", "[::1]:80"), "::1");
  EXPECT_EQ(*HostOfAddress("--http", "plant:80"), "plant");
  for (const char* address : {"", "plant", ":80", "plant:", "plant:65536", "plant:-1"}) {
    const absl::Status status = HostOfAddress("--http", address).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << address;
    EXPECT_THAT(std::string(status.message()), HasSubstr("--http"));
  }
}

TEST(AdmitJob, SaysThatTheQueueIsFullAndKnowsJobsAllTheSame) {
  const auto jobs = MakeInMemoryJobStore(1, {.max_jobs = 1});
  const auto admit = [&](const char* request_id) {
    return AdmitJob(
        jobs.get(), "render", request_id, [] { return "spec"; }, "a", [] { return 1; });
  };
  auto first = admit("id");
  ASSERT_TRUE(first.ok() && first->room != nullptr && !first->known) << first.status();
  const absl::Status full = admit("another").status();
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_EQ(ErrorReason(full), "QUEUE_FULL");
  const auto made = jobs->Create(
      "render", "id", "spec",
      [](JobContext& context) -> absl::StatusOr<std::string> {
        while (!context.cancelled()) std::this_thread::yield();
        return absl::CancelledError();
      },
      std::move(first->room));
  ASSERT_TRUE(made.ok()) << made.status();
  EXPECT_EQ(ErrorReason(admit("another").status()), "QUEUE_FULL");
  const auto known = admit("id");
  ASSERT_TRUE(known.ok() && known->known && known->room == nullptr) << known.status();
  EXPECT_EQ(known->known->job_id(), made->job_id);
}

TEST(RpcServerWithoutJobsTest, HasNoJobServiceAndDrains) {
  RunningRpcServer running(/*with_jobs=*/false);
  RpcServerOptions options;
  options.listen = "127.0.0.1:0";
  const absl::Status status = running.server().Listen(options, {});
  ASSERT_TRUE(status.ok()) << status;
  const auto channel =
      grpc::CreateChannel(running.server().address(), grpc::InsecureChannelCredentials());
  EXPECT_EQ(CallOver(channel).status.code(), absl::StatusCode::kUnimplemented);
  EXPECT_TRUE(running.server().Drain(absl::Hours(24)));
}

}  // namespace
}  // namespace sightline
