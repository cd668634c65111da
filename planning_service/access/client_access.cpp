// SPDX-License-Identifier: Apache-2.0
#include "planning_service/access/client_access.h"

#include <fcntl.h>
#include <openssl/crypto.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/access/clients_file.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr std::chrono::seconds kCheckInterval{1};
// One byte more than the parser takes, so that the parser itself refuses larger files.
constexpr int64_t kMaxReadBytes = (4 << 20) + 1;

absl::Status Unknown(const std::string& message) {
  return WithErrorInfo(absl::UnauthenticatedError(message), "CREDENTIALS_UNKNOWN");
}

// Identity of a file's version, which changes when the file is written or replaced.
struct FileVersion {
  int64_t seconds = 0;
  int64_t nanoseconds = 0;
  int64_t size_bytes = 0;
  uint64_t inode = 0;

  friend bool operator==(const FileVersion&, const FileVersion&) = default;
};

FileVersion VersionOf(const struct stat& info) {
  return {info.st_mtim.tv_sec, info.st_mtim.tv_nsec, info.st_size, info.st_ino};
}

absl::Status CannotRead(const std::string& file, int error) {
  const std::string message = absl::StrCat(file, ": cannot be read: ", std::strerror(error));
  return error == ENOENT || error == ENOTDIR ? absl::NotFoundError(message)
                                             : absl::InvalidArgumentError(message);
}

struct FileContent {
  std::string text;
  FileVersion version;
};

absl::StatusOr<FileContent> ReadFile(const std::string& file) {
  // O_NONBLOCK: a pipe in place of the file must not hold up every call.
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return CannotRead(file, errno);
  FileContent content;
  struct stat info {};
  int error = fstat(fd, &info) != 0 ? errno : 0;
  if (error == 0 && !S_ISREG(info.st_mode)) {
    close(fd);
    return absl::InvalidArgumentError(absl::StrCat(file, ": is not a regular file"));
  }
  content.version = VersionOf(info);
  char buffer[65536];
  while (error == 0 && static_cast<int64_t>(content.text.size()) < kMaxReadBytes) {
    const ssize_t count = read(fd, buffer, sizeof(buffer));
    if (count == 0) break;
    if (count > 0) {
      content.text.append(buffer, static_cast<size_t>(count));
    } else if (errno != EINTR) {
      error = errno;
    }
  }
  close(fd);
  if (error != 0) return CannotRead(file, error);
  return content;
}

// The client with this token. Every client is compared, and every comparison takes the same time,
// so that the time of an answer does not depend on the token.
const Client* ClientOfToken(const KnownClients& known, const std::string& token) {
  const TokenDigest digest = DigestOfToken(token);
  const TokenDigest none{};
  const Client* found = nullptr;
  for (size_t i = 0; i < known.clients.size(); ++i) {
    const std::optional<TokenDigest>& own = known.token_digests[i];
    const bool same =
        CRYPTO_memcmp(own ? own->data() : none.data(), digest.data(), digest.size()) == 0;
    if (same && own) found = &known.clients[i];
  }
  return found;
}

class FileClientAccess final : public ClientAccess {
 public:
  FileClientAccess(std::string file, FileVersion version, KnownClients known)
      : file_(std::move(file)),
        version_(version),
        known_(std::make_shared<const KnownClients>(std::move(known))),
        checked_(std::chrono::steady_clock::now()) {}

  absl::StatusOr<Client> Identify(const PeerCredentials& peer) override {
    const std::shared_ptr<const KnownClients> known = Current();
    if (peer.certificate_names.empty() && peer.bearer_token.empty()) {
      return Unknown("no credentials: a client certificate or a bearer token is needed");
    }
    std::set<const Client*> by_certificate;
    for (const std::string& name : peer.certificate_names) {
      const auto found = known->client_of_certificate_name.find(name);
      if (found != known->client_of_certificate_name.end()) {
        by_certificate.insert(&known->clients[found->second]);
      }
    }
    // All failed authentications get the same message, so that they cannot be distinguished.
    const absl::Status nobody =
        Unknown("the credentials given are not those of one client of this service");
    if (by_certificate.size() > 1) return nobody;
    const Client* certified = by_certificate.empty() ? nullptr : *by_certificate.begin();
    if (!peer.certificate_names.empty() && certified == nullptr) return nobody;
    if (peer.bearer_token.empty()) return *certified;
    const Client* with_token = ClientOfToken(*known, peer.bearer_token);
    if (with_token == nullptr) return nobody;
    if (certified != nullptr && certified != with_token) return nobody;
    return *with_token;
  }

  ClientQuota QuotaOf(const std::string& client) override {
    const std::shared_ptr<const KnownClients> known = Current();
    const auto found = std::find_if(known->clients.begin(), known->clients.end(),
                                    [&](const Client& c) { return c.name == client; });
    return found == known->clients.end() ? ClientQuota{} : found->quota;
  }

 private:
  // The clients that the file names; reads the file again if it has changed.
  std::shared_ptr<const KnownClients> Current() {
    std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (now - checked_ < kCheckInterval) return known_;
    checked_ = now;
    struct stat info {};
    if (stat(file_.c_str(), &info) != 0) {
      // The warning is logged once, not every second.
      if (version_ != FileVersion{}) Warn(std::strerror(errno));
      version_ = FileVersion{};
      return known_;
    }
    if (VersionOf(info) == version_) return known_;
    version_ = VersionOf(info);
    absl::StatusOr<FileContent> content = ReadFile(file_);
    absl::StatusOr<KnownClients> known =
        content.ok() ? ParseClientsFile(content->text, file_) : content.status();
    if (!known.ok()) {
      Warn(std::string(known.status().message()));
      return known_;
    }
    version_ = content->version;
    known_ = std::make_shared<const KnownClients>(*std::move(known));
    spdlog::info("event=clients_read file={:?} clients={}", file_, known_->clients.size());
    return known_;
  }

  void Warn(const std::string& reason) const {
    spdlog::warn("event=clients_kept file={:?} message={:?}", file_, reason);
  }

  const std::string file_;
  std::mutex mutex_;
  FileVersion version_;  // of the contents read last, right or wrong
  std::shared_ptr<const KnownClients> known_;
  std::chrono::steady_clock::time_point checked_;
};

class EverybodyAccess final : public ClientAccess {
 public:
  absl::StatusOr<Client> Identify(const PeerCredentials&) override {
    Client client;
    client.name = "local";
    client.is_operator = true;
    client.max_priority = 100;
    return client;
  }
  ClientQuota QuotaOf(const std::string&) override { return {}; }
};

}  // namespace

bool Client::MayAsk(const std::string& kind) const {
  return kinds.empty() || std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

std::unique_ptr<ClientAccess> AllowEverybody() { return std::make_unique<EverybodyAccess>(); }

absl::StatusOr<std::unique_ptr<ClientAccess>> ReadClientAccess(const std::string& file) {
  SIGHTLINE_ASSIGN_OR_RETURN(FileContent content, ReadFile(file));
  SIGHTLINE_ASSIGN_OR_RETURN(KnownClients known, ParseClientsFile(content.text, file));
  return std::make_unique<FileClientAccess>(file, content.version, std::move(known));
}

}  // namespace sightline
