// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/tls_server_context.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/status/status_macros.h"
#include "planning_service/access/certificate_names.h"

namespace sightline {
namespace {

// Reason of the last error of OpenSSL in this thread; clears the queue of errors.
std::string OpenSslReason() {
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  const char* reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  return reason == nullptr ? "cannot be read" : reason;
}

absl::Status Unusable(const std::string& option, const std::string& file) {
  return absl::InvalidArgumentError(absl::StrCat(option, ": ", file, ": ", OpenSslReason()));
}

absl::StatusOr<std::shared_ptr<SSL_CTX>> ReadFiles(const TlsFiles& files) {
  ERR_clear_error();
  std::shared_ptr<SSL_CTX> context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  if (context == nullptr) return absl::InternalError(OpenSslReason());
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  // No session resumption, so that every connection is verified against the current authorities.
  SSL_CTX_set_options(context.get(), SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_TICKET |
                                         SSL_OP_CIPHER_SERVER_PREFERENCE |
                                         SSL_OP_IGNORE_UNEXPECTED_EOF);
  SSL_CTX_set_session_cache_mode(context.get(), SSL_SESS_CACHE_OFF);
  SSL_CTX_set_num_tickets(context.get(), 0);
  SSL_CTX_set_mode(context.get(),
                   SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  if (SSL_CTX_use_certificate_chain_file(context.get(), files.certificate.c_str()) != 1) {
    return Unusable("--tls-cert", files.certificate);
  }
  if (SSL_CTX_use_PrivateKey_file(context.get(), files.key.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context.get()) != 1) {
    return Unusable("--tls-key", files.key);
  }
  if (!files.client_ca.empty()) {
    STACK_OF(X509_NAME)* names = SSL_load_client_CA_file(files.client_ca.c_str());
    if (names == nullptr ||
        SSL_CTX_load_verify_locations(context.get(), files.client_ca.c_str(), nullptr) != 1) {
      sk_X509_NAME_pop_free(names, X509_NAME_free);
      return Unusable("--tls-client-ca", files.client_ca);
    }
    SSL_CTX_set_client_CA_list(context.get(), names);  // takes the names
    SSL_CTX_set_verify(context.get(), SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  }
  return context;
}

// A text of sizes and times that changes if a file is written or replaced.
std::string LookOf(const TlsFiles& files) {
  std::string look;
  for (const std::string& file : {files.certificate, files.key, files.client_ca}) {
    struct stat status {};
    if (file.empty() || stat(file.c_str(), &status) != 0) {
      look += "-;";
      continue;
    }
    absl::StrAppend(&look, status.st_ino, ":", status.st_size, ":", status.st_mtim.tv_sec, ".",
                    status.st_mtim.tv_nsec, ";");
  }
  return look;
}

}  // namespace

TlsServerContext::TlsServerContext(TlsFiles files, absl::Duration check_interval)
    : files_(std::move(files)), check_interval_(check_interval) {}

absl::StatusOr<std::unique_ptr<TlsServerContext>> TlsServerContext::Load(
    const TlsFiles& files, absl::Duration check_interval) {
  std::unique_ptr<TlsServerContext> context(new TlsServerContext(files, check_interval));
  context->seen_ = LookOf(files);
  SIGHTLINE_ASSIGN_OR_RETURN(context->context_, ReadFiles(files));
  context->checked_ = std::chrono::steady_clock::now();
  return context;
}

std::shared_ptr<SSL_CTX> TlsServerContext::Current() {
  const auto now = std::chrono::steady_clock::now();
  if (now - checked_ < absl::ToChronoNanoseconds(check_interval_)) return context_;
  checked_ = now;
  // Taken before the files are read: a change in between is then found at the next check.
  std::string look = LookOf(files_);
  if (look == seen_) return context_;
  seen_ = std::move(look);
  absl::StatusOr<std::shared_ptr<SSL_CTX>> read = ReadFiles(files_);
  if (read.ok()) {
    context_ = *std::move(read);
    spdlog::info("event=tls_certificate_changed file={}", files_.certificate);
  } else {
    spdlog::warn("event=tls_certificate_kept reason={:?}", read.status().ToString());
  }
  return context_;
}

std::vector<std::string> VerifiedPeerNames(SSL* connection) {
  const std::unique_ptr<X509, void (*)(X509*)> certificate(SSL_get1_peer_certificate(connection),
                                                           X509_free);
  if (certificate == nullptr || (SSL_get_verify_mode(connection) & SSL_VERIFY_PEER) == 0 ||
      SSL_get_verify_result(connection) != X509_V_OK) {
    return {};
  }
  return CertificateNames(certificate.get());
}

}  // namespace sightline
