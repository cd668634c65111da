// SPDX-License-Identifier: Apache-2.0
// A server asked whether it serves, by the standard gRPC health protocol.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sightline {

struct HealthCheckOptions {
  std::string address;  // "unix:PATH" or "HOST:PORT"
  // E.g. "sightline.v1.CoverageService": whether it takes more work now; at most 127 bytes. Empty:
  // whether the server is alive.
  std::string service;
  // PEM files that turn on TLS, shown to servers that want a client's certificate. The server's own
  // certificate is not checked: it gets no secret, and its name is seldom that of the address.
  std::string tls_certificate_file;
  std::string tls_key_file;
  absl::Duration timeout = absl::Seconds(3);
};

// OK: the server says SERVING. UNAVAILABLE: it says something else, or does not answer in time.
// INVALID_ARGUMENT: certificate and key cannot be used.
absl::Status CheckHealth(const HealthCheckOptions& options);

// For programs in containers, which have no other client beside them: with `--health-check ADDRESS
// [--health-service NAME] [--tls-cert FILE --tls-key FILE]` among the arguments prints SERVING, or
// the reason to stderr, and returns the exit code (0 serving, 1 not, 2 wrong arguments). Without
// it: nothing.
std::optional<int> MaybeCheckHealth(int argc, const char* const* argv);

}  // namespace sightline
