// SPDX-License-Identifier: Apache-2.0
// TLS of gRPC servers.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// PEM files. Certificate and key turn on TLS. With a client CA, clients need a certificate of it.
struct TlsFiles {
  std::string certificate;
  std::string key;
  std::string client_ca;
};

// Without a certificate the credentials are insecure ones (plain text). The files are read again
// every two seconds, for connections made afterwards. While certificate and key do not belong
// together, or a file cannot be read, new connections may fail; existing ones stay.
// INVALID_ARGUMENT names option, file and reason.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> MakeServerCredentials(
    const TlsFiles& files);

}  // namespace sightline
