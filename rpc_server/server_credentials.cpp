// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/server_credentials.h"

#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <fstream>
#include <sstream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr unsigned int kReadInterval_s = 2;

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

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

Bio MemoryOf(const std::string& text) {
  return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), &BIO_free};
}

// A server cannot ask for the password of an encrypted key.
int NoPassword(char*, int, int, void*) { return 0; }

Certificate FirstCertificate(const std::string& pem) {
  return {PEM_read_bio_X509(MemoryOf(pem).get(), nullptr, &NoPassword, nullptr), &X509_free};
}

// Checks the files now, because the provider below takes any files and fails at each connection.
absl::Status CheckContent(const TlsFiles& files, const std::string& certificate_pem,
                          const std::string& key_pem) {
  const Certificate certificate = FirstCertificate(certificate_pem);
  if (certificate == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("--tls-cert: ", files.certificate, " holds no certificate"));
  }
  const Key key(PEM_read_bio_PrivateKey(MemoryOf(key_pem).get(), nullptr, &NoPassword, nullptr),
                &EVP_PKEY_free);
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("--tls-key: ", files.key, " holds no private key without a password"));
  }
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--tls-key: ", files.key, " is not the key of the certificate in ", files.certificate));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> MakeServerCredentials(
    const TlsFiles& files) {
  if (files.certificate.empty() != files.key.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together");
  }
  if (files.certificate.empty()) {
    if (!files.client_ca.empty()) {
      return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key");
    }
    return grpc::InsecureServerCredentials();
  }
  SIGHTLINE_ASSIGN_OR_RETURN(std::string certificate, ReadPem("--tls-cert", files.certificate));
  SIGHTLINE_ASSIGN_OR_RETURN(std::string key, ReadPem("--tls-key", files.key));
  SIGHTLINE_RETURN_IF_ERROR(CheckContent(files, certificate, key));
  if (!files.client_ca.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(std::string ca, ReadPem("--tls-client-ca", files.client_ca));
    if (FirstCertificate(ca) == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat("--tls-client-ca: ", files.client_ca, " holds no certificate"));
    }
  }
  grpc::experimental::TlsServerCredentialsOptions options(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          files.key, files.certificate, files.client_ca, kReadInterval_s));
  options.watch_identity_key_cert_pairs();
  if (files.client_ca.empty()) {
    options.set_cert_request_type(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  } else {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

}  // namespace sightline
