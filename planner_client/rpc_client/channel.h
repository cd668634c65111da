// SPDX-License-Identifier: Apache-2.0
// What the clients of every server have in common.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "absl/time/time.h"
#include "planner_client/embedded_server/embedded_server.h"

namespace sightline {

// Where a server is and how it is reached.
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

  // Of the embedded server if there is one.
  const std::string& Address() const { return embedded != nullptr ? embedded->address() : address; }
};

// Finds a server that was restarted quickly; does not try calls again by itself. Calls carry the
// CurrentTraceparent() of the thread that makes them.
std::shared_ptr<grpc::Channel> OpenChannel(const ServerAccess& access);

// Deadline of a call, from now on.
void SetTimeout(grpc::ClientContext* context, absl::Duration timeout);
// Time for sending so many bytes.
absl::Duration UploadTimeout(size_t bytes);

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
