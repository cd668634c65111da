// SPDX-License-Identifier: Apache-2.0
// TLS of the HTTP front end, with certificates that may change while it runs.
#pragma once

#include <openssl/ssl.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

struct TlsFiles {
  std::string certificate;
  std::string key;
  std::string client_ca;  // empty: clients need no certificate
};

// Not thread-safe; the contexts that it returns are.
class TlsServerContext {
 public:
  // INVALID_ARGUMENT names option and file. Current() checks the files for changes at most once in
  // `check_interval`.
  static absl::StatusOr<std::unique_ptr<TlsServerContext>> Load(const TlsFiles& files,
                                                                absl::Duration check_interval);

  // The context for a new connection. Reads the files again if they have changed; if they are
  // unusable, logs a warning and keeps the old context.
  std::shared_ptr<SSL_CTX> Current();

 private:
  TlsServerContext(TlsFiles files, absl::Duration check_interval);

  const TlsFiles files_;
  const absl::Duration check_interval_;
  std::shared_ptr<SSL_CTX> context_;
  std::string seen_;  // sizes and times of the files that were read last
  std::chrono::steady_clock::time_point checked_;
};

// Names of the peer's verified certificate (certificate_names.h); empty if it has none.
std::vector<std::string> VerifiedPeerNames(SSL* connection);

}  // namespace sightline
