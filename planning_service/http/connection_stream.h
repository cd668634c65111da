// SPDX-License-Identifier: Apache-2.0
// Bytes of one connection, plain or TLS, with deadlines.
#pragma once

#include <openssl/ssl.h>

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "planning_service/http/listening_socket.h"

namespace sightline {

// For one thread, except CutOff. No method blocks beyond its deadline.
class ConnectionStream {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Outcome { kDone, kClosed, kTimedOut };

  // `socket` must not block. `stop_event` becomes readable when the server ends.
  ConnectionStream(FileDescriptor socket, int stop_event);
  ~ConnectionStream();

  // Performs the TLS handshake; the connection uses TLS from then on.
  Outcome StartTls(SSL_CTX* context, Clock::time_point deadline);
  // Names in the client's certificate.
  std::vector<std::string> PeerNames() const;

  // Waits until there is something to read; kClosed also when the server ends.
  Outcome WaitForRequest(Clock::time_point deadline);
  // Reads at least one byte, at most `size`.
  Outcome Read(char* bytes, size_t size, Clock::time_point deadline, size_t* count);
  // Writes all `size` bytes.
  Outcome Write(const char* bytes, size_t size, Clock::time_point deadline);
  // True if the peer is known to have closed the connection; does not wait.
  bool PeerIsGone() const;
  bool IsEnding() const;
  // Closes the sending side, then discards incoming data until `deadline`. Closing at once would
  // reset the connection, and a client that is still sending would lose the answer.
  void Finish(Clock::time_point deadline);
  // May be called from any thread: makes all methods above fail.
  void CutOff();

 private:
  struct SslFree {
    void operator()(SSL* ssl) const { SSL_free(ssl); }
  };
  // Waits for bytes on the socket or the end of the server.
  Outcome WaitForSocket(Clock::time_point deadline) const;
  // Waits for `events` of poll().
  Outcome Wait(short events, Clock::time_point deadline) const;
  // After a call of OpenSSL that returned `result` <= 0: waits for the socket as it asks.
  Outcome WaitForTls(int result, Clock::time_point deadline) const;

  const FileDescriptor socket_;
  const int stop_event_;
  std::unique_ptr<SSL, SslFree> ssl_;
};

}  // namespace sightline
