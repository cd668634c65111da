// SPDX-License-Identifier: Apache-2.0
// Rights of clients: the clients file of `sightline serve --clients`.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planning_service/job_store/planning_job_store.h"

namespace sightline {

// The credentials that a peer presents.
struct PeerCredentials {
  // Names of the client certificate, verified by TLS (certificate_names.h).
  std::vector<std::string> certificate_names;
  // Token of the header "Authorization: Bearer TOKEN"; empty: none.
  std::string bearer_token;
};

struct Client {
  std::string name;
  std::vector<std::string> kinds;  // jobs it may ask for; empty: all
  bool is_operator = false;        // sees and cancels jobs of all clients
  ClientQuota quota;
  int max_priority = 0;  // greatest priority it may give
  int64_t max_upload_bytes = int64_t{2} << 30;

  bool MayAsk(const std::string& kind) const;
};

// Thread-safe. Reads its file again when it has changed. If the new contents are wrong, logs a
// warning and keeps the old ones.
class ClientAccess {
 public:
  virtual ~ClientAccess() = default;
  // UNAUTHENTICATED, reason CREDENTIALS_UNKNOWN; the message never says how close a token was.
  virtual absl::StatusOr<Client> Identify(const PeerCredentials& peer) = 0;
  // Quota of the client of that name, for the queue; the defaults if the file does not name the
  // client any more.
  virtual ClientQuota QuotaOf(const std::string& client) = 0;
};

// Identifies every peer as the operator "local". For addresses that only this machine reaches.
std::unique_ptr<ClientAccess> AllowEverybody();
// INVALID_ARGUMENT names file, field and reason; NOT_FOUND names the file.
absl::StatusOr<std::unique_ptr<ClientAccess>> ReadClientAccess(const std::string& file);

}  // namespace sightline
