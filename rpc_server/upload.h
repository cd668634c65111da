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
  SharedLimit::Share memory;  // counts `bytes`; keep it while they exist
};

// Counts bytes that have arrived towards the share of `peer`. An announced size alone counts
// nothing. UNAVAILABLE (OVERLOADED): the peer, or all peers together, have more uploads in memory
// than allowed.
absl::Status GrowUpload(SharedLimit::Share* memory, const std::string& peer, int64_t bytes);

inline constexpr size_t kMaxUploadChunkBytes = 1 << 20;
// Slower uploads are ended once the idle timeout has passed, so that many small messages do not
// hold memory for hours. It is a tenth of the speed that our own clients expect.
inline constexpr double kSlowestUpload_bytes_per_s = 1e5;

// Passes every chunk to `take(chunk)`; an error of `take` ends the call. The header has been read
// from `reader` and announced `size` bytes. INVALID_ARGUMENT: a message without a chunk, an empty
// or too large chunk, or another number of bytes. DEADLINE_EXCEEDED: the upload is too slow.
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
    // Messages without bytes would keep a call and its thread busy for nothing.
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

// Collects the chunks in memory; `memory` limits the bytes of all uploads. Errors as
// ForEachChunk; UNAVAILABLE as GrowUpload.
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
