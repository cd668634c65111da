// SPDX-License-Identifier: Apache-2.0
#include "planning_service/events/read_secret.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

constexpr size_t kMaxSecretBytes = 4096;

}  // namespace

absl::StatusOr<std::string> ReadSecret(const std::string& option, const std::string& file) {
  const auto error = [&](const std::string& reason) {
    return absl::InvalidArgumentError(absl::StrCat(option, " ", file, ": ", reason));
  };
  // O_NONBLOCK: the file may be a pipe without a writer.
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return error(absl::StrCat("cannot be read: ", std::strerror(errno)));
  struct stat info {};
  std::string secret;
  int failure = 0;
  if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) {
    close(fd);
    return error("is not a regular file");
  }
  char buffer[kMaxSecretBytes + 3];
  while (failure == 0 && secret.size() < sizeof(buffer)) {
    const ssize_t count = read(fd, buffer, sizeof(buffer) - secret.size());
    if (count == 0) break;
    if (count > 0) {
      secret.append(buffer, static_cast<size_t>(count));
    } else if (errno != EINTR) {
      failure = errno;
    }
  }
  close(fd);
  if (failure != 0) return error(absl::StrCat("cannot be read: ", std::strerror(failure)));
  if (!secret.empty() && secret.back() == '\n') secret.pop_back();
  if (!secret.empty() && secret.back() == '\r') secret.pop_back();
  if (secret.empty()) return error("is empty");
  if (secret.size() > kMaxSecretBytes) {
    return error(absl::StrCat("is longer than ", kMaxSecretBytes, " bytes"));
  }
  return secret;
}

}  // namespace sightline
