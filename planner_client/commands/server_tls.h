// SPDX-License-Identifier: Apache-2.0
// TLS between a command and remote servers.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "absl/status/status.h"
#include "planner_client/rpc_client/channel.h"

namespace sightline {

// PEM files. The authority enables TLS; certificate and key are for servers that require them.
struct ServerTlsOptions {
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
  // Name in the server's certificate if it differs from the host of the address.
  std::string server_name;

  bool given() const {
    return !ca_file.empty() || !certificate_file.empty() || !key_file.empty() ||
           !server_name.empty();
  }
};

// --tls-ca, --tls-cert, --tls-key, --tls-server-name.
void AddServerTlsOptions(CLI::App& app, ServerTlsOptions* options);

// For commands with two servers whose options were read into `worker`: copies them to each server
// that is remote.
void GiveBothServersTls(const std::string& coverage_address, ServerTlsOptions* coverage,
                        const std::string& worker_address, ServerTlsOptions* worker);

// Reads the files into `access`. INVALID_ARGUMENT names the option, the file and the reason. It is
// also returned if `has_server` is false: no remote server uses the options.
absl::Status UseServerTls(const ServerTlsOptions& options, bool has_server, ServerAccess* access);

}  // namespace sightline
