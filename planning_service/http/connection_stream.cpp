// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/connection_stream.h"

#include <openssl/err.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <utility>

#include "planning_service/http/tls_server_context.h"

namespace sightline {
namespace {

int MillisecondsUntil(ConnectionStream::Clock::time_point deadline) {
  const auto left =
      std::chrono::ceil<std::chrono::milliseconds>(deadline - ConnectionStream::Clock::now())
          .count();
  return static_cast<int>(std::clamp<int64_t>(left, 0, INT_MAX));
}

// OpenSSL counts in int.
int Clamped(size_t size) { return static_cast<int>(std::min<size_t>(size, INT_MAX)); }

}  // namespace

ConnectionStream::ConnectionStream(FileDescriptor socket, int stop_event)
    : socket_(std::move(socket)), stop_event_(stop_event) {}

ConnectionStream::~ConnectionStream() = default;

ConnectionStream::Outcome ConnectionStream::Wait(short events, Clock::time_point deadline) const {
  for (;;) {
    pollfd entry{socket_.get(), events, 0};
    const int count = poll(&entry, 1, MillisecondsUntil(deadline));
    if (count > 0) return Outcome::kDone;  // errors show at the next read or write
    if (count == 0) return Outcome::kTimedOut;
    if (errno != EINTR) return Outcome::kClosed;
  }
}

ConnectionStream::Outcome ConnectionStream::WaitForTls(int result,
                                                       Clock::time_point deadline) const {
  switch (SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return Wait(POLLIN, deadline);
    case SSL_ERROR_WANT_WRITE:
      return Wait(POLLOUT, deadline);
    default:
      ERR_clear_error();
      return Outcome::kClosed;
  }
}

ConnectionStream::Outcome ConnectionStream::StartTls(SSL_CTX* context, Clock::time_point deadline) {
  ssl_.reset(SSL_new(context));
  if (ssl_ == nullptr || SSL_set_fd(ssl_.get(), socket_.get()) != 1) return Outcome::kClosed;
  for (;;) {
    ERR_clear_error();
    const int result = SSL_accept(ssl_.get());
    if (result == 1) return Outcome::kDone;
    const Outcome outcome = WaitForTls(result, deadline);
    if (outcome != Outcome::kDone) return outcome;
  }
}

std::vector<std::string> ConnectionStream::PeerNames() const {
  return ssl_ == nullptr ? std::vector<std::string>() : VerifiedPeerNames(ssl_.get());
}

ConnectionStream::Outcome ConnectionStream::WaitForRequest(Clock::time_point deadline) {
  if (ssl_ != nullptr && SSL_has_pending(ssl_.get())) return Outcome::kDone;
  return WaitForSocket(deadline);
}

ConnectionStream::Outcome ConnectionStream::WaitForSocket(Clock::time_point deadline) const {
  for (;;) {
    pollfd entries[2] = {{socket_.get(), POLLIN, 0}, {stop_event_, POLLIN, 0}};
    const int count = poll(entries, 2, MillisecondsUntil(deadline));
    if (count == 0) return Outcome::kTimedOut;
    if (count < 0 && errno == EINTR) continue;
    return count > 0 && entries[1].revents == 0 ? Outcome::kDone : Outcome::kClosed;
  }
}

ConnectionStream::Outcome ConnectionStream::Read(char* bytes, size_t size,
                                                 Clock::time_point deadline, size_t* count) {
  *count = 0;
  for (;;) {
    Outcome outcome = Outcome::kClosed;
    if (ssl_ != nullptr) {
      ERR_clear_error();
      const int result = SSL_read(ssl_.get(), bytes, Clamped(size));
      if (result > 0) {
        *count = static_cast<size_t>(result);
        return Outcome::kDone;
      }
      outcome = WaitForTls(result, deadline);
    } else {
      const ssize_t result = recv(socket_.get(), bytes, size, 0);
      if (result > 0) {
        *count = static_cast<size_t>(result);
        return Outcome::kDone;
      }
      if (result == 0) return Outcome::kClosed;
      if (errno == EINTR) continue;
      if (errno == EAGAIN) outcome = Wait(POLLIN, deadline);
    }
    if (outcome != Outcome::kDone) return outcome;
  }
}

ConnectionStream::Outcome ConnectionStream::Write(const char* bytes, size_t size,
                                                  Clock::time_point deadline) {
  while (size > 0) {
    Outcome outcome = Outcome::kClosed;
    ssize_t result = 0;
    if (ssl_ != nullptr) {
      ERR_clear_error();
      result = SSL_write(ssl_.get(), bytes, Clamped(size));
      if (result <= 0) outcome = WaitForTls(static_cast<int>(result), deadline);
    } else {
      result = send(socket_.get(), bytes, size, MSG_NOSIGNAL);
      if (result < 0 && errno == EINTR) continue;
      if (result < 0 && errno == EAGAIN) outcome = Wait(POLLOUT, deadline);
    }
    if (result > 0) {
      bytes += result;
      size -= static_cast<size_t>(result);
    } else if (outcome != Outcome::kDone) {
      return outcome;
    }
  }
  return Outcome::kDone;
}

bool ConnectionStream::PeerIsGone() const {
  pollfd entry{socket_.get(), POLLRDHUP, 0};
  return poll(&entry, 1, 0) > 0 && (entry.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
}

bool ConnectionStream::IsEnding() const {
  pollfd entry{stop_event_, POLLIN, 0};
  return poll(&entry, 1, 0) > 0;
}

void ConnectionStream::Finish(Clock::time_point deadline) {
  if (ssl_ != nullptr && SSL_is_init_finished(ssl_.get())) {
    ERR_clear_error();
    SSL_shutdown(ssl_.get());
    ERR_clear_error();
  }
  shutdown(socket_.get(), SHUT_WR);
  char discarded[1 << 16];
  while (WaitForSocket(deadline) == Outcome::kDone && Clock::now() < deadline) {
    const ssize_t count = recv(socket_.get(), discarded, sizeof(discarded), 0);
    if (count == 0 || (count < 0 && errno != EINTR && errno != EAGAIN)) return;
  }
}

void ConnectionStream::CutOff() { shutdown(socket_.get(), SHUT_RDWR); }

}  // namespace sightline
