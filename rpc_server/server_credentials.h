// SPDX-License-Identifier: Apache-2.0
// TLS of gRPC servers.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// PEM files. Certificate and key: TLS; a client CA as well: clients must have a certificate of it.
struct TlsFiles {
  std::string certificate;
  std::string key;
  std::string client_ca;
};

// Without a certificate: none. The files are read anew every two seconds: connections made
// afterwards use what they hold then. While certificate and key do not belong together, or a file
// cannot be read, new connections may fail; existing ones stay.
// INVALID_ARGUMENT names option, file and reason.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> MakeServerCredentials(
    const TlsFiles& files);

}  // namespace sightline
