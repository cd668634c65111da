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

// Not thread-safe; its contexts are.
class TlsServerContext {
 public:
  // INVALID_ARGUMENT names option and file. The files are looked at again at most once in
  // `check_interval`.
  static absl::StatusOr<std::unique_ptr<TlsServerContext>> Load(const TlsFiles& files,
                                                                absl::Duration check_interval);

  // For a new connection. Reads the files again if they changed; unusable files leave the old ones
  // in place, with a warning in the log.
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
