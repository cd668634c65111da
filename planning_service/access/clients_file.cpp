// SPDX-License-Identifier: Apache-2.0
#include "planning_service/access/clients_file.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/digest/sha256.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "sightline/v1/planning_access.pb.h"

namespace sightline {
namespace {

constexpr size_t kMaxFileBytes = 4 << 20;
constexpr int kMaxClients = 1000;
constexpr int kMaxCertificateNames = 100;
constexpr size_t kMaxNameBytes = 64;
constexpr size_t kMaxCertificateNameBytes = 256;
constexpr int64_t kMaxBytes = 1'000'000'000'000'000;
const char* const kKinds[] = {"plan",   "evaluate", "inspect", "accept",
                              "optics", "render",   "verify",  "diagnose"};

// The parser quotes the text that is wrong, which may be a token.
std::string WithoutSecrets(const std::string& message) {
  for (const char* quoted : {"; last read:", "token_sha256: is "}) {
    const size_t found = message.find(quoted);
    if (found != std::string::npos) {
      return absl::StrCat(message.substr(0, found),
                          quoted[0] == ';' ? "" : "token_sha256: must be 64 hex digits in quotes");
    }
  }
  return message;
}

bool IsClientName(const std::string& name) {
  return !name.empty() && name.size() <= kMaxNameBytes &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
         });
}

bool IsCertificateName(const std::string& name) {
  return !name.empty() && name.size() <= kMaxCertificateNameBytes &&
         std::none_of(name.begin(), name.end(),
                      [](unsigned char c) { return absl::ascii_iscntrl(c); });
}

class Reader {
 public:
  explicit Reader(const std::string& file) : file_(file) {}

  absl::StatusOr<KnownClients> Read(const v1::ClientsFile& entries) {
    if (entries.clients_size() > kMaxClients) {
      return Error("clients", absl::StrCat("has ", entries.clients_size(), " entries, at most ",
                                           kMaxClients, " are allowed"));
    }
    for (int i = 0; i < entries.clients_size(); ++i) {
      SIGHTLINE_RETURN_IF_ERROR(Add(entries.clients(i), absl::StrCat("clients[", i, "]")));
    }
    return std::move(known_);
  }

 private:
  absl::Status Error(const std::string& field, const std::string& reason) const {
    return absl::InvalidArgumentError(absl::StrCat(file_, ": ", field, ": ", reason));
  }

  absl::Status CheckRange(const std::string& field, int64_t value, int64_t least,
                          int64_t greatest) const {
    if (value >= least && value <= greatest) return absl::OkStatus();
    return Error(field, absl::StrCat("is ", value, ", must be in [", least, ", ", greatest, "]"));
  }

  absl::Status Add(const v1::ClientEntry& entry, const std::string& path) {
    Client client;
    client.name = entry.name();
    if (!IsClientName(client.name)) {
      return Error(
          path + ".name",
          absl::StrCat("is \"", absl::CEscape(client.name.substr(0, kMaxNameBytes)),
                       "\", must be 1 to ", kMaxNameBytes, " letters, digits, '.', '_' or '-'"));
    }
    // The entry has a valid name, so messages can use it.
    const std::string who = absl::StrCat(path, " (", client.name, ")");
    for (const Client& other : known_.clients) {
      if (other.name == client.name) {
        return Error(who, "another client has this name");
      }
    }
    if (entry.certificate_names().empty() && entry.token_sha256().empty()) {
      return Error(who, "needs certificate_names, token_sha256 or both");
    }
    const size_t index = known_.clients.size();
    SIGHTLINE_RETURN_IF_ERROR(AddCertificateNames(entry, who, index));
    SIGHTLINE_RETURN_IF_ERROR(AddToken(entry, who));

    for (const std::string& kind : entry.kinds()) {
      if (std::find(std::begin(kKinds), std::end(kKinds), kind) == std::end(kKinds)) {
        return Error(who + ".kinds", absl::StrCat("has \"", absl::CEscape(kind.substr(0, 60)),
                                                  "\"; known are ", absl::StrJoin(kKinds, ", ")));
      }
      client.kinds.push_back(kind);
    }
    client.is_operator = entry.operator_();
    if (entry.has_max_priority()) client.max_priority = entry.max_priority();
    if (entry.has_max_queued_jobs()) client.quota.max_queued_jobs = entry.max_queued_jobs();
    if (entry.has_max_running_jobs()) client.quota.max_running_jobs = entry.max_running_jobs();
    if (entry.has_max_stored_bytes()) client.quota.max_stored_bytes = entry.max_stored_bytes();
    if (entry.has_max_upload_bytes()) client.max_upload_bytes = entry.max_upload_bytes();
    for (const absl::Status& status :
         {CheckRange(who + ".max_priority", client.max_priority, -100, 100),
          CheckRange(who + ".max_queued_jobs", client.quota.max_queued_jobs, 0, 1'000'000),
          CheckRange(who + ".max_running_jobs", client.quota.max_running_jobs, 0, 1000),
          CheckRange(who + ".max_stored_bytes", client.quota.max_stored_bytes, 0, kMaxBytes),
          CheckRange(who + ".max_upload_bytes", client.max_upload_bytes, 1, kMaxBytes)}) {
      if (!status.ok()) return status;
    }
    known_.clients.push_back(std::move(client));
    return absl::OkStatus();
  }

  absl::Status AddCertificateNames(const v1::ClientEntry& entry, const std::string& who,
                                   size_t index) {
    if (entry.certificate_names_size() > kMaxCertificateNames) {
      return Error(who + ".certificate_names",
                   absl::StrCat("has more than ", kMaxCertificateNames, " names"));
    }
    for (const std::string& name : entry.certificate_names()) {
      const std::string shown =
          absl::StrCat("\"", absl::CEscape(name.substr(0, kMaxCertificateNameBytes)), "\"");
      if (!IsCertificateName(name)) {
        return Error(who + ".certificate_names",
                     absl::StrCat("has ", shown, ", must have 1 to ", kMaxCertificateNameBytes,
                                  " bytes without control characters"));
      }
      const auto [place, is_new] = known_.client_of_certificate_name.emplace(name, index);
      if (!is_new) {
        return Error(who + ".certificate_names",
                     place->second == index
                         ? absl::StrCat("has ", shown, " twice")
                         : absl::StrCat("has ", shown, ", which client ",
                                        known_.clients[place->second].name, " has too"));
      }
    }
    return absl::OkStatus();
  }

  absl::Status AddToken(const v1::ClientEntry& entry, const std::string& who) {
    if (entry.token_sha256().empty()) {
      known_.token_digests.push_back(std::nullopt);
      return absl::OkStatus();
    }
    const std::string& hex = entry.token_sha256();
    TokenDigest digest;
    if (hex.size() != 2 * digest.size() || !std::all_of(hex.begin(), hex.end(), [](char c) {
          return absl::ascii_isxdigit(static_cast<unsigned char>(c));
        })) {
      return Error(who + ".token_sha256", "must be 64 hex digits, the SHA-256 of the token");
    }
    const std::string bytes = absl::HexStringToBytes(hex);
    std::copy(bytes.begin(), bytes.end(), digest.begin());
    if (digest == DigestOfToken("")) {
      return Error(who + ".token_sha256", "is that of an empty token");
    }
    for (size_t i = 0; i < known_.token_digests.size(); ++i) {
      if (known_.token_digests[i] == digest) {
        return Error(who + ".token_sha256",
                     absl::StrCat("client ", known_.clients[i].name, " has the same token"));
      }
    }
    known_.token_digests.push_back(digest);
    return absl::OkStatus();
  }

  const std::string& file_;
  KnownClients known_;
};

}  // namespace

TokenDigest DigestOfToken(const std::string& token) {
  Sha256 digest;
  digest.Update(token);
  return digest.Finish();
}

absl::StatusOr<KnownClients> ParseClientsFile(const std::string& json, const std::string& file) {
  if (json.size() > kMaxFileBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": larger than ", kMaxFileBytes, " bytes"));
  }
  v1::ClientsFile entries;
  if (absl::Status status = ParseStrictJson(json, file, &entries); !status.ok()) {
    return absl::Status(status.code(), WithoutSecrets(std::string(status.message())));
  }
  return Reader(file).Read(entries);
}

}  // namespace sightline
