// SPDX-License-Identifier: Apache-2.0
// Inputs of servers: requests by HTTP and gRPC, their files, what their commands say.
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>

#include "core/trace/trace_context.h"
#include "coverage_server/service/scene_spec.h"
#include "planning_service/access/clients_file.h"
#include "planning_service/events/receiver_url.h"
#include "planning_service/execution/command_messages.h"
#include "planning_service/http/http_connection.h"
#include "planning_service/http/http_reply.h"
#include "planning_service/http/multipart_reader.h"
#include "tests/fuzz/fuzz_inputs.h"
#include "tests/fuzz/fuzz_targets.h"

namespace sightline {
namespace {

// All that a client sends on one connection.
void ServeHttp(std::string_view bytes) {
  // A socket holds this many bytes without a reader.
  bytes = bytes.substr(0, 16 << 10);
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends) != 0) std::abort();
  const FileDescriptor client(ends[0]);
  const FileDescriptor stop(eventfd(0, EFD_CLOEXEC));
  (void)write(client.get(), bytes.data(), bytes.size());
  shutdown(client.get(), SHUT_WR);
  ConnectionStream stream(FileDescriptor(ends[1]), stop.get());
  ServeHttpConnection(&stream,
                      {.max_request_bytes = 1 << 20, .request_timeout = absl::Milliseconds(20)},
                      [](HttpExchange& exchange) {
                        size_t size = 0;
                        for (auto piece = exchange.ReadBody(); piece.ok() && !piece->empty();
                             piece = exchange.ReadBody()) {
                          size += piece->size();
                        }
                        ReplyText(exchange, 200, {}, "text/plain", absl::StrCat(size));
                      });
}

// First line: the Content-Type; the rest: the body, in pieces.
void ReadMultipart(std::string_view bytes) {
  const size_t line = std::min(bytes.find('\n'), bytes.size());
  const auto boundary = MultipartBoundary(std::string(bytes.substr(0, line)));
  if (!boundary.ok()) return;
  std::string_view rest = bytes.substr(std::min(line + 1, bytes.size()));
  MultipartReader reader(*boundary, [&]() -> absl::StatusOr<std::string> {
    const std::string piece(rest.substr(0, 7));
    rest.remove_prefix(piece.size());
    return piece;
  });
  for (auto part = reader.NextPart(); part.ok() && part->has_value(); part = reader.NextPart()) {
    for (auto piece = reader.Read(); piece.ok() && !piece->empty(); piece = reader.Read()) {
    }
  }
}

void ReadTarget(std::string_view bytes) {
  const auto target = ParseRequestTarget(std::string(bytes));
  if (!target.ok()) return;
  for (const std::string& segment : target->path) {
    const auto again = PercentDecode(PercentEncode(segment, false));
    if (!again.ok() || *again != segment) std::abort();
  }
}

void ReadScene(std::string_view bytes) {
  v1::SceneSpec spec;
  if (!spec.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  const auto parsed = ParseSceneSpec(spec);
  if (!parsed.ok()) return;
  // The normal form is one.
  const auto again = ParseSceneSpec(parsed->normalised);
  if (!again.ok() || again->digest != parsed->digest) std::abort();
}

}  // namespace

std::map<std::string, FuzzTarget> ServiceTargets() {
  return {
      {"http_requests", ServeHttp},
      {"http_multipart", ReadMultipart},
      {"http_target", ReadTarget},
      {"receiver_url",
       [](std::string_view bytes) {
         (void)ParseReceiverUrl("--webhook", std::string(bytes)).ok();
       }},
      {"traceparent",
       [](std::string_view bytes) {
         const std::string valid = ValidTraceparent(bytes);
         if (ValidTraceparent(valid) != valid) std::abort();
       }},
      {"clients_json",
       [](std::string_view bytes) {
         (void)ParseClientsFile(std::string(bytes), "clients.json").ok();
       }},
      {"command_messages",
       [](std::string_view bytes) {
         CommandMessages messages;
         for (; !bytes.empty(); bytes.remove_prefix(std::min<size_t>(5, bytes.size()))) {
           messages.Add(bytes.data(), std::min<size_t>(5, bytes.size()));
         }
       }},
      {"scene_spec", ReadScene},
  };
}

}  // namespace sightline
