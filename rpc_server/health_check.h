// SPDX-License-Identifier: Apache-2.0
// Asks a server whether it serves, by the standard gRPC health protocol.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sightline {

struct HealthCheckOptions {
  std::string address;  // "unix:PATH" or "HOST:PORT"
  // Service, e.g. "sightline.v1.CoverageService", that is asked whether it takes more work now; at
  // most 127 bytes. Empty: the server is asked whether it is alive.
  std::string service;
  // PEM files that turn on TLS; servers that require a client certificate get it. The server's
  // certificate is not checked: the server gets no secret, and its name is seldom the address.
  std::string tls_certificate_file;
  std::string tls_key_file;
  absl::Duration timeout = absl::Seconds(3);
};

// OK: the server answers SERVING. UNAVAILABLE: it answers otherwise, or not in time.
// INVALID_ARGUMENT: certificate and key cannot be used, or `service` is too long.
absl::Status CheckHealth(const HealthCheckOptions& options);

// For programs in containers that hold no other client. If the arguments have `--health-check
// ADDRESS [--health-service NAME] [--tls-cert FILE --tls-key FILE]`, prints SERVING, or the reason
// to stderr, and returns the exit code (0 serving, 1 not, 2 wrong arguments). Otherwise does
// nothing and returns nullopt.
std::optional<int> MaybeCheckHealth(int argc, const char* const* argv);

}  // namespace sightline
