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

// How a peer shows who it is.
struct PeerCredentials {
  // Names of a client certificate that TLS has verified: certificate_names.h.
  std::vector<std::string> certificate_names;
  // From "Authorization: Bearer TOKEN"; empty: none.
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

// Thread-safe. Reads its file anew when it changed; keeps what it had, with a warning in the log,
// when the new one is wrong.
class ClientAccess {
 public:
  virtual ~ClientAccess() = default;
  // UNAUTHENTICATED, reason CREDENTIALS_UNKNOWN; the message never says how near a token was.
  virtual absl::StatusOr<Client> Identify(const PeerCredentials& peer) = 0;
  // Quota by the name of a client, for the queue; defaults for one that is not in the file any
  // more.
  virtual ClientQuota QuotaOf(const std::string& client) = 0;
};

// Everybody is the client "local", an operator. For addresses that only this machine reaches.
std::unique_ptr<ClientAccess> AllowEverybody();
// INVALID_ARGUMENT names file, field and reason; NOT_FOUND names the file.
absl::StatusOr<std::unique_ptr<ClientAccess>> ReadClientAccess(const std::string& file);

}  // namespace sightline
