// SPDX-License-Identifier: Apache-2.0
// Functions that the clients of every server have in common.
//
// How long a client waits: as long as the server shows that it is there, and no longer. Calls that
// do work have no deadline, because a time that is ample on an idle machine is short on a busy one,
// and the plan that a call belongs to may have taken hours. The signs of life are:
// - of an embedded server its process. When it ends, the kernel closes its socket and every call
//   ends with UNAVAILABLE.
// - of a remote server its answers to HTTP/2 pings (gRPC keepalive). They tell a server that
//   computes from a machine or network that is gone. Each call under way ends with UNAVAILABLE
//   after kSilence without an answer.
// UNAVAILABLE is tried again. A user ends the wait for a server that is there and does not finish
// with Ctrl-C. Calls that work cancels on the way out have a deadline (SetTimeout), since their
// answer is not needed.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "absl/time/time.h"
#include "planner_client/embedded_server/embedded_server.h"

namespace sightline {

// Address of a server and how it is reached.
struct ServerAccess {
  // "unix:PATH" or "HOST:PORT". Not used with an embedded server.
  std::string address;
  // Must outlive the client. May be null.
  EmbeddedServer* embedded = nullptr;
  // PEM texts. Root certificates turn on TLS; certificate and key are for mTLS.
  std::string tls_root_certificates;
  std::string tls_certificate;
  std::string tls_key;
  // Name in the server's certificate where it is not the host of the address. Empty: it is.
  std::string tls_server_name;

  // Address of the embedded server if there is one.
  const std::string& Address() const { return embedded != nullptr ? embedded->address() : address; }
};

// A remote server that answers no ping for the sum of both is taken for lost. Its limit for pings
// that come too often must be below kPingInterval: rpc_server/rpc_server.cpp.
inline constexpr absl::Duration kPingInterval = absl::Seconds(60);
inline constexpr absl::Duration kSilence = absl::Seconds(60);

// Finds a server that was restarted quickly; does not try calls again by itself. Calls carry the
// CurrentTraceparent() of the thread that makes them.
std::shared_ptr<grpc::Channel> OpenChannel(const ServerAccess& access);

// Deadline, from now on, of a call whose answer is of no use: one that cancels a job.
void SetTimeout(grpc::ClientContext* context, absl::Duration timeout);

// Different every time.
std::string NewRequestId();

// Pause before the next attempt after `attempt` failed ones; doubles.
absl::Duration RetryPause(int attempt);

// Sends a file: `message` with its header first, then with chunks. A stream that breaks says why
// when it is finished.
template <typename Request>
void WriteUpload(grpc::ClientWriter<Request>& writer, Request message, const std::string& bytes) {
  constexpr size_t kChunkBytes = 512 << 10;
  bool open = writer.Write(message);
  for (size_t begin = 0; open && begin < bytes.size(); begin += kChunkBytes) {
    message.set_chunk(bytes.substr(begin, kChunkBytes));
    open = writer.Write(message);
  }
  writer.WritesDone();
}

}  // namespace sightline
