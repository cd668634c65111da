// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/result_reply.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <map>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "planning_service/http/http_reply.h"
#include "planning_service/http/listening_socket.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

constexpr size_t kPieceBytes = 64 << 10;

// Reports embed their scripts, styles and pictures. The sandbox gives them an origin of their own,
// so that no script in them can use the service in the reader's name.
constexpr char kReportPolicy[] =
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'";

}  // namespace

std::string ContentTypeOf(const std::string& name) {
  static const auto& types = *new std::map<std::string, std::string>{
      {"bmp", "image/bmp"},
      {"csv", "text/csv; charset=utf-8"},
      {"exr", "image/x-exr"},
      {"glb", "model/gltf-binary"},
      {"html", "text/html; charset=utf-8"},
      {"json", "application/json"},
      {"log", "text/plain; charset=utf-8"},
      {"md", "text/markdown; charset=utf-8"},
      {"obj", "model/obj"},
      {"pgm", "image/x-portable-graymap"},
      {"png", "image/png"},
      {"qif", "application/xml"},
      {"stl", "model/stl"},
      {"svg", "image/svg+xml"},
      {"tif", "image/tiff"},
      {"tiff", "image/tiff"},
      {"txt", "text/plain; charset=utf-8"},
      {"xml", "application/xml"},
      {"zip", "application/zip"},
  };
  const size_t dot = name.rfind('.');
  const auto type =
      types.find(dot == std::string::npos ? "" : absl::AsciiStrToLower(name.substr(dot + 1)));
  return type == types.end() ? "application/octet-stream" : type->second;
}

bool MatchesEntityTag(absl::string_view if_none_match, absl::string_view entity_tag) {
  for (absl::string_view tag : absl::StrSplit(if_none_match, ',')) {
    tag = absl::StripAsciiWhitespace(tag);
    if (tag == "*") return true;
    absl::ConsumePrefix(&tag, "W/");
    if (tag == entity_tag) return true;
  }
  return false;
}

std::optional<ByteRange> ParseByteRange(absl::string_view header, int64_t size_bytes) {
  header = absl::StripAsciiWhitespace(header);
  if (!absl::ConsumePrefix(&header, "bytes=")) return std::nullopt;
  const size_t dash = header.find('-');
  if (dash == absl::string_view::npos || header.find(',') != absl::string_view::npos) {
    return std::nullopt;
  }
  const absl::string_view first_text = absl::StripAsciiWhitespace(header.substr(0, dash));
  const absl::string_view last_text = absl::StripAsciiWhitespace(header.substr(dash + 1));
  const auto number = [](absl::string_view text, int64_t* value) {
    return !text.empty() && absl::ascii_isdigit(static_cast<unsigned char>(text.front())) &&
           absl::SimpleAtoi(text, value);
  };
  int64_t first = 0;
  int64_t last = size_bytes - 1;
  if (first_text.empty()) {
    int64_t suffix = 0;
    if (!number(last_text, &suffix)) return std::nullopt;
    suffix = std::min(suffix, size_bytes);
    return ByteRange{size_bytes - suffix, suffix};
  }
  if (!number(first_text, &first)) return std::nullopt;
  if (!last_text.empty() && (!number(last_text, &last) || last < first)) return std::nullopt;
  if (first >= size_bytes) return ByteRange{0, 0};
  return ByteRange{first, std::min(last, size_bytes - 1) - first + 1};
}

void ReplyResult(HttpExchange& exchange, const OpenResult& result) {
  const FileDescriptor file(open(result.path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (file.get() < 0 || fstat(file.get(), &status) != 0 ||
      status.st_size != result.file.size_bytes) {
    ReplyError(exchange, absl::DataLossError(
                             absl::StrCat("the bytes of result ", result.file.name, " are lost")));
    return;
  }
  const HttpRequest& request = exchange.request();
  const std::string tag = absl::StrCat("\"", result.file.digest, "\"");
  // A result never changes, but the right to read it can.
  HttpHeaders headers = {{"ETag", tag}, {"Cache-Control", "private, no-cache"}};
  if (MatchesEntityTag(request.Header("if-none-match"), tag)) {
    ReplyText(exchange, 304, headers, "", "");
    return;
  }
  headers.emplace_back("Accept-Ranges", "bytes");
  ByteRange range{0, result.file.size_bytes};
  int http_status = 200;
  const std::string if_range = request.Header("if-range");
  if (if_range.empty() || if_range == tag) {
    if (const auto asked = ParseByteRange(request.Header("range"), result.file.size_bytes)) {
      if (asked->length == 0) {
        ReplyError(exchange,
                   WithErrorInfo(absl::OutOfRangeError(absl::StrCat(
                                     "Range: the result has ", result.file.size_bytes, " bytes")),
                                 "RANGE_NOT_SATISFIABLE"),
                   {{"Content-Range", absl::StrCat("bytes */", result.file.size_bytes)}});
        return;
      }
      range = *asked;
      http_status = 206;
      headers.emplace_back("Content-Range", absl::StrCat("bytes ", range.offset, "-",
                                                         range.offset + range.length - 1, "/",
                                                         result.file.size_bytes));
    }
  }
  const std::string type = ContentTypeOf(result.file.name);
  headers.emplace_back("Content-Type", type);
  if (absl::StrContains(type, "html") || absl::StrContains(type, "xml")) {
    headers.emplace_back("Content-Security-Policy", kReportPolicy);
  }
  if (!exchange.Begin(http_status, headers, range.length).ok()) return;
  if (request.method == "HEAD") {
    exchange.End().IgnoreError();
    return;
  }
  std::string piece(kPieceBytes, '\0');
  int64_t sent = 0;
  while (sent < range.length) {
    const auto wanted = static_cast<size_t>(std::min<int64_t>(range.length - sent, kPieceBytes));
    const ssize_t count = pread(file.get(), piece.data(), wanted, range.offset + sent);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      // The answer has begun: only a closed connection can show that it is incomplete.
      spdlog::error("event=result_unreadable digest={}", result.file.digest);
      return;
    }
    if (!exchange.Write(absl::string_view(piece.data(), static_cast<size_t>(count))).ok()) return;
    sent += count;
  }
  exchange.End().IgnoreError();
}

}  // namespace sightline
