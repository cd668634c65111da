// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/health_check.h"

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr char kFlag[] = "--health-check";
// grpc.health.v1.HealthCheckResponse with status SERVING (field 1, value 1). The message has no
// generated code in Debian's packages.
constexpr char kServing[] = "\x08\x01";

absl::StatusOr<std::string> ReadFile(const std::string& option, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) return absl::InvalidArgumentError(absl::StrCat(option, ": cannot read ", path));
  return text.str();
}

class AnyServer final : public grpc::experimental::ExternalCertificateVerifier {
 public:
  bool Verify(grpc::experimental::TlsCustomVerificationCheckRequest*,
              std::function<void(grpc::Status)>, grpc::Status* status) override {
    *status = grpc::Status::OK;
    return true;
  }
  void Cancel(grpc::experimental::TlsCustomVerificationCheckRequest*) override {}
};

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> Credentials(
    const HealthCheckOptions& options) {
  if (options.tls_certificate_file.empty() != options.tls_key_file.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together");
  }
  if (options.tls_certificate_file.empty()) return grpc::InsecureChannelCredentials();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto certificate,
                             ReadFile("--tls-cert", options.tls_certificate_file));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto key, ReadFile("--tls-key", options.tls_key_file));
  const std::vector<grpc::experimental::IdentityKeyCertPair> pairs = {{key, certificate}};
  grpc::experimental::TlsChannelCredentialsOptions tls;
  tls.set_certificate_provider(
      std::make_shared<grpc::experimental::StaticDataCertificateProvider>(pairs));
  tls.watch_identity_key_cert_pairs();
  tls.set_verify_server_certs(false);
  tls.set_check_call_host(false);
#ifndef __clang_analyzer__  // It reports a leak of memory that gRPC owns.
  tls.set_certificate_verifier(
      grpc::experimental::ExternalCertificateVerifier::Create<AnyServer>());
#endif
  return grpc::experimental::TlsCredentials(tls);
}

std::string Bytes(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  if (!buffer.Dump(&slices).ok()) return "";
  std::string bytes;
  for (const grpc::Slice& slice : slices) {
    bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  }
  return bytes;
}

}  // namespace

absl::Status CheckHealth(const HealthCheckOptions& options) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto credentials, Credentials(options));
  grpc::GenericStub stub(grpc::CreateChannel(options.address, credentials));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + absl::ToChronoSeconds(options.timeout));
  if (options.service.size() > 127) {
    return absl::InvalidArgumentError("--health-service: at most 127 bytes");
  }
  // HealthCheckRequest with field 1, or nothing at all.
  const grpc::Slice bytes(
      options.service.empty()
          ? std::string()
          : absl::StrCat("\x0a", std::string(1, static_cast<char>(options.service.size())),
                         options.service));
  const grpc::ByteBuffer request(&bytes, 1);
  grpc::CompletionQueue queue;
  const auto call =
      stub.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", request, &queue);
  call->StartCall();
  grpc::ByteBuffer answer;
  grpc::Status status;
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  if (!status.ok()) {
    return absl::UnavailableError(absl::StrCat(options.address, ": ", status.error_message()));
  }
  if (Bytes(answer) != kServing) {
    return absl::UnavailableError(absl::StrCat(options.address, ": NOT_SERVING"));
  }
  return absl::OkStatus();
}

std::optional<int> MaybeCheckHealth(int argc, const char* const* argv) {
  bool asked = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    asked = asked || word == kFlag || word.substr(0, sizeof(kFlag)) == absl::StrCat(kFlag, "=");
  }
  if (!asked) return std::nullopt;
  HealthCheckOptions options;
  CLI::App app("Asks a server whether it serves.");
  app.add_option(kFlag, options.address, "unix:PATH or HOST:PORT")->required();
  app.add_option("--health-service", options.service, "Service by name; default: the server");
  app.add_option("--tls-cert", options.tls_certificate_file, "PEM certificate; turns on TLS");
  app.add_option("--tls-key", options.tls_key_file, "PEM private key");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  const absl::Status health = CheckHealth(options);
  if (health.ok()) {
    std::printf("SERVING\n");
    return 0;
  }
  std::fprintf(stderr, "%s\n", std::string(health.message()).c_str());
  return absl::IsInvalidArgument(health) ? 2 : 1;
}

}  // namespace sightline
