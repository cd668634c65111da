// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/server_tls.h"

#include <fstream>
#include <sstream>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Certificates of an authority and their like; a device without end must not be read in.
constexpr size_t kMostPemBytes = 4 << 20;

absl::StatusOr<std::string> ReadPem(const std::string& option, const std::string& path) {
  if (path.empty()) return std::string();
  std::ifstream file(path, std::ios::binary);
  std::string text(kMostPemBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(file.gcount()));
  if (text.size() > kMostPemBytes || !absl::StrContains(text, "-----BEGIN ")) {
    return absl::InvalidArgumentError(
        absl::StrCat(option, ": ", path, " is not a readable PEM file"));
  }
  return text;
}

}  // namespace

void AddServerTlsOptions(CLI::App& app, ServerTlsOptions* options) {
  app.add_option("--tls-ca", options->ca_file,
                 "PEM certificates of the authority of a server that runs elsewhere; turns on TLS");
  app.add_option("--tls-cert", options->certificate_file,
                 "PEM certificate chain to show to that server");
  app.add_option("--tls-key", options->key_file, "PEM private key of --tls-cert");
  app.add_option("--tls-server-name", options->server_name,
                 "name in that server's certificate where it is not the host of its address");
}

void GiveBothServersTls(const std::string& coverage_address, ServerTlsOptions* coverage,
                        const std::string& worker_address, ServerTlsOptions* worker) {
  if (!coverage_address.empty() || worker_address.empty()) *coverage = *worker;
  if (worker_address.empty()) *worker = {};
}

absl::Status UseServerTls(const ServerTlsOptions& options, bool has_server, ServerAccess* access) {
  if (!options.given()) return absl::OkStatus();
  if (!has_server) {
    return absl::InvalidArgumentError(
        "--tls-ca, --tls-cert, --tls-key and --tls-server-name are for a server that runs "
        "elsewhere; give its address, too");
  }
  if (options.certificate_file.empty() != options.key_file.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together");
  }
  if (options.ca_file.empty()) {
    return absl::InvalidArgumentError("--tls-cert, --tls-key and --tls-server-name need --tls-ca");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto ca, ReadPem("--tls-ca", options.ca_file));
  SIGHTLINE_ASSIGN_OR_RETURN(auto certificate, ReadPem("--tls-cert", options.certificate_file));
  SIGHTLINE_ASSIGN_OR_RETURN(auto key, ReadPem("--tls-key", options.key_file));
  access->tls_root_certificates = std::move(ca);
  access->tls_certificate = std::move(certificate);
  access->tls_key = std::move(key);
  access->tls_server_name = options.server_name;
  return absl::OkStatus();
}

}  // namespace sightline
