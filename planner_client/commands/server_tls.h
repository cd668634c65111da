// SPDX-License-Identifier: Apache-2.0
// TLS between a command and servers that run elsewhere.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "absl/status/status.h"
#include "planner_client/rpc_client/channel.h"

namespace sightline {

// PEM files. The authority turns TLS on; certificate and key are for servers that ask for them.
struct ServerTlsOptions {
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
  // Name in the server's certificate where it is not the one of the address.
  std::string server_name;

  bool given() const {
    return !ca_file.empty() || !certificate_file.empty() || !key_file.empty() ||
           !server_name.empty();
  }
};

// --tls-ca, --tls-cert, --tls-key, --tls-server-name.
void AddServerTlsOptions(CLI::App& app, ServerTlsOptions* options);

// For commands with two servers, whose options were read into `worker`: each of those that run
// elsewhere gets them.
void GiveBothServersTls(const std::string& coverage_address, ServerTlsOptions* coverage,
                        const std::string& worker_address, ServerTlsOptions* worker);

// Reads the files into `access`. INVALID_ARGUMENT names the option, the file and the reason, also
// when there is no server elsewhere to use them with: `has_server` is false.
absl::Status UseServerTls(const ServerTlsOptions& options, bool has_server, ServerAccess* access);

}  // namespace sightline
