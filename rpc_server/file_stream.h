// SPDX-License-Identifier: Apache-2.0
// Files that servers send piece by piece: a header, then chunks.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/sync_stream.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "rpc_server/call_tracker.h"

namespace sightline {

inline constexpr int64_t kSentChunkBytes = 512 << 10;

// Sends the bytes [`begin`, `end`) of the file at `path` as chunks in messages of `response`.
// DATA_LOSS: the file, called `name` in the message, has become shorter or cannot be read. Also
// returns the errors of CallTracker::Write and CheckStop.
template <typename Response>
absl::Status SendChunks(CallTracker* calls, grpc::ServerContext* context,
                        grpc::ServerWriter<Response>* writer, const std::string& path,
                        const std::string& name, int64_t begin, int64_t end, Response* response) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(begin);
  std::string chunk;
  for (int64_t left = end - begin; left > 0;) {
    SIGHTLINE_RETURN_IF_ERROR(calls->CheckStop(context));
    chunk.resize(static_cast<size_t>(std::min(left, kSentChunkBytes)));
    if (!file.read(chunk.data(), static_cast<std::streamsize>(chunk.size()))) {
      return absl::DataLossError(absl::StrCat(name, ": cannot be read any more"));
    }
    response->set_chunk(chunk);
    SIGHTLINE_RETURN_IF_ERROR(calls->Write(context, [&] { return writer->Write(*response); }));
    left -= static_cast<int64_t>(chunk.size());
  }
  return absl::OkStatus();
}

}  // namespace sightline
