// SPDX-License-Identifier: Apache-2.0
// Functions that the clients of every server have in common.
//
// A client waits exactly as long as the server shows signs of life. Calls that do work have no
// deadline: a limit that is ample on an idle machine is short on a busy one, and the plan behind a
// call may have taken hours. The signs of life are:
// - for an embedded server, its process. When it ends, the kernel closes its socket and every call
//   ends with UNAVAILABLE.
// - for a remote server, its answers to HTTP/2 pings (gRPC keepalive). They distinguish a server
//   that computes from a lost machine or network. Each running call ends with UNAVAILABLE after
//   kSilence without an answer.
// UNAVAILABLE is retried. A user ends the wait for a server that is alive but does not finish with
// Ctrl-C. Calls that cancel work on the way out have a deadline (SetTimeout), since their answer is
// not needed.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "absl/time/time.h"
#include "planner_client/embedded_server/embedded_server.h"

namespace sightline {

// Address of a server and the way to reach it.
struct ServerAccess {
  // "unix:PATH" or "HOST:PORT". Not used with an embedded server.
  std::string address;
  // Must outlive the client. May be null.
  EmbeddedServer* embedded = nullptr;
  // PEM texts. Root certificates turn on TLS; certificate and key are for mTLS.
  std::string tls_root_certificates;
  std::string tls_certificate;
  std::string tls_key;
  // Name in the server's certificate; if empty, the host of the address.
  std::string tls_server_name;

  // Address of the embedded server if there is one.
  const std::string& Address() const { return embedded != nullptr ? embedded->address() : address; }
};

// A remote server that answers no ping for the sum of both counts as lost. The server's lower limit
// for ping intervals must be below kPingInterval: rpc_server/rpc_server.cpp.
inline constexpr absl::Duration kPingInterval = absl::Seconds(60);
inline constexpr absl::Duration kSilence = absl::Seconds(60);

// Finds a server that was restarted quickly; the channel does not retry calls by itself. Calls
// carry the CurrentTraceparent() of the calling thread.
std::shared_ptr<grpc::Channel> OpenChannel(const ServerAccess& access);

// Sets a deadline, relative to now, for a call whose answer is not needed, as one that cancels a
// job.
void SetTimeout(grpc::ClientContext* context, absl::Duration timeout);

// Returns a unique id.
std::string NewRequestId();

// Pause before the next attempt after `attempt` failed ones; doubles.
absl::Duration RetryPause(int attempt);

// Sends a file: `message` first with its header, then with chunks. If the stream breaks, its final
// status has the reason.
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
