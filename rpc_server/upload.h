// SPDX-License-Identifier: Apache-2.0
// Files that clients send piece by piece: a header, then chunks.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/sync_stream.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "core/admission/shared_limit.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "rpc_server/call_tracker.h"

namespace sightline {

struct ReceivedFile {
  std::string bytes;
  SharedLimit::Share memory;  // for as long as the bytes are there
};

// Takes memory for bytes that came; who announces much and sends nothing takes nothing.
// UNAVAILABLE (OVERLOADED): `peer`, whose share it is, or all peers together are uploading too
// much.
absl::Status GrowUpload(SharedLimit::Share* memory, const std::string& peer, int64_t bytes);

inline constexpr size_t kMaxUploadChunkBytes = 1 << 20;
// Slower uploads are ended, once the idle timeout has passed: many small messages must not keep
// memory for hours. A tenth of the speed that our own clients expect.
inline constexpr double kSlowestUpload_bytes_per_s = 1e5;

// Hands every chunk after a header that announced `size` bytes to `take(chunk)`, whose errors end
// the call; `reader` stands behind the header. INVALID_ARGUMENT: something else came, or not so
// many bytes; DEADLINE_EXCEEDED: too slowly.
template <typename Request, typename Take>
absl::Status ForEachChunk(CallTracker* calls, grpc::ServerContext* context,
                          grpc::ServerReader<Request>* reader, int64_t size, const Take& take) {
  const auto start = std::chrono::steady_clock::now();
  int64_t received = 0;
  Request message;
  while (true) {
    SIGHTLINE_ASSIGN_OR_RETURN(const bool more,
                               calls->Read(context, [&] { return reader->Read(&message); }));
    if (!more) break;
    if (message.content_case() != Request::kChunk) {
      return InvalidFields({{"chunk", "every message after the header must have one"}});
    }
    const std::string& chunk = message.chunk();
    if (chunk.size() > kMaxUploadChunkBytes) {
      return InvalidFields(
          {{"chunk", absl::StrCat(chunk.size(), " bytes: at most ", kMaxUploadChunkBytes)}});
    }
    // A stream of messages without bytes would keep a call and its thread busy for nothing.
    if (chunk.empty() && size > 0) {
      return InvalidFields({{"chunk", "is empty"}});
    }
    received += static_cast<int64_t>(chunk.size());
    if (received > size) {
      return InvalidFields({{"header.size_bytes", absl::StrCat(size, ": more bytes followed")}});
    }
    const absl::Duration duration = absl::FromChrono(std::chrono::steady_clock::now() - start);
    if (duration > calls->limits().idle_timeout +
                       absl::Seconds(static_cast<double>(received) / kSlowestUpload_bytes_per_s)) {
      return absl::DeadlineExceededError(
          absl::StrCat("the upload is slower than ", kSlowestUpload_bytes_per_s, " bytes/s"));
    }
    SIGHTLINE_RETURN_IF_ERROR(take(chunk));
  }
  SIGHTLINE_RETURN_IF_ERROR(calls->CheckStop(context));
  if (received != size) {
    return InvalidFields(
        {{"header.size_bytes", absl::StrCat(size, ": only ", received, " bytes followed")}});
  }
  return absl::OkStatus();
}

// The same chunks in memory, of which `memory` limits the bytes. Errors of ForEachChunk;
// UNAVAILABLE: too much at a time.
template <typename Request>
absl::StatusOr<ReceivedFile> ReceiveChunks(CallTracker* calls, grpc::ServerContext* context,
                                           grpc::ServerReader<Request>* reader, int64_t size,
                                           const SharedLimit& memory) {
  const std::string peer = PeerOf(*context);
  ReceivedFile file{"", memory.Of(peer)};
  const auto keep = [&](const std::string& chunk) -> absl::Status {
    absl::Status room = GrowUpload(&file.memory, peer, static_cast<int64_t>(chunk.size()));
    if (room.ok()) file.bytes += chunk;
    return room;
  };
  SIGHTLINE_RETURN_IF_ERROR(ForEachChunk(calls, context, reader, size, keep));
  return file;
}

}  // namespace sightline
