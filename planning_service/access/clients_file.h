// SPDX-License-Identifier: Apache-2.0
// Reads and checks the clients file.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/digest/sha256.h"
#include "planning_service/access/client_access.h"

namespace sightline {

using TokenDigest = Sha256::Bytes;

TokenDigest DigestOfToken(const std::string& token);

struct KnownClients {
  std::vector<Client> clients;
  std::vector<std::optional<TokenDigest>> token_digests;  // one per client
  std::map<std::string, size_t> client_of_certificate_name;
};

// `json`: a v1::ClientsFile of at most 4 MiB. INVALID_ARGUMENT names `file`, the field and the
// reason, but never the content of a field about tokens.
absl::StatusOr<KnownClients> ParseClientsFile(const std::string& json, const std::string& file);

}  // namespace sightline
