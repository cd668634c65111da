// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/listening_socket.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/text/number.h"

namespace sightline {
namespace {

bool IsLoopback(const sockaddr_storage& address) {
  if (address.ss_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
    return (ntohl(v4.sin_addr.s_addr) >> 24) == 127;
  }
  const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
  return IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr) ||
         (IN6_IS_ADDR_V4MAPPED(&v6.sin6_addr) && v6.sin6_addr.s6_addr[12] == 127);
}

int PortOf(const sockaddr_storage& address) {
  return ntohs(address.ss_family == AF_INET
                   ? reinterpret_cast<const sockaddr_in&>(address).sin_port
                   : reinterpret_cast<const sockaddr_in6&>(address).sin6_port);
}

}  // namespace

FileDescriptor::~FileDescriptor() {
  if (descriptor_ >= 0) close(descriptor_);
}

FileDescriptor::FileDescriptor(FileDescriptor&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

absl::StatusOr<ListeningSocket> ListenTcp(const std::string& option, const std::string& listen) {
  const size_t colon = listen.rfind(':');
  const auto port = ParseUnsigned(listen.substr(colon == std::string::npos ? 0 : colon + 1));
  std::string host = colon == std::string::npos ? "" : listen.substr(0, colon);
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  if (bracketed) host = host.substr(1, host.size() - 2);
  if (host.empty() || (!bracketed && host.find(':') != std::string::npos) || !port.ok() ||
      *port > 65535) {
    return absl::InvalidArgumentError(
        absl::StrCat(option, " ", listen, ": must be HOST:PORT or [IPv6]:PORT"));
  }
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), std::to_string(*port).c_str(), &hints, &found);
      error != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(option, " ", listen, ": ", host, ": ", gai_strerror(error)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  int error = EADDRNOTAVAIL;
  for (const addrinfo* entry = found; entry != nullptr; entry = entry->ai_next) {
    FileDescriptor descriptor(
        socket(entry->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int on = 1;
    // SO_REUSEADDR lets a new server follow an old one at once; two at a time stay impossible.
    if (descriptor.get() < 0 ||
        setsockopt(descriptor.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0 ||
        bind(descriptor.get(), entry->ai_addr, entry->ai_addrlen) != 0 ||
        ::listen(descriptor.get(), 128) != 0) {
      error = errno;
      continue;
    }
    sockaddr_storage actual{};
    socklen_t length = sizeof(actual);
    if (getsockname(descriptor.get(), reinterpret_cast<sockaddr*>(&actual), &length) != 0) {
      error = errno;
      continue;
    }
    return ListeningSocket{.descriptor = std::move(descriptor),
                           .host = host,
                           .address = absl::StrCat(bracketed ? absl::StrCat("[", host, "]") : host,
                                                   ":", PortOf(actual)),
                           .is_loopback = IsLoopback(actual)};
  }
  return absl::UnavailableError(
      absl::StrCat(option, " ", listen, ": cannot listen there: ", std::strerror(error)));
}

}  // namespace sightline
