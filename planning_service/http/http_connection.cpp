// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/http_connection.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/buffer_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/status.hpp>
#include <chrono>
#include <exception>
#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "core/status/status_macros.h"
#include "core/trace/trace_context.h"
#include "planning_service/http/http_reply.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace http = boost::beast::http;
using boost::system::error_code;
using Clock = ConnectionStream::Clock;
using Outcome = ConnectionStream::Outcome;
using Parser = http::request_parser<http::buffer_body>;

constexpr size_t kMaxHeadBytes = 32 << 10;
constexpr size_t kPieceBytes = 64 << 10;
constexpr int64_t kMinBodyBytesPerSecond = 4 << 10;
// Time for which a client may go on sending after an early answer.
constexpr std::chrono::seconds kLingerTime(5);

std::string Text(boost::string_view text) { return std::string(text.data(), text.size()); }

absl::Status LostConnection(Outcome outcome) {
  if (outcome == Outcome::kTimedOut) {
    return WithErrorInfo(absl::DeadlineExceededError("the request came too slowly"),
                         "REQUEST_TIMEOUT");
  }
  return absl::CancelledError("the client has closed the connection");
}

absl::Status ParseError(const error_code& error) {
  if (error == http::error::body_limit) {
    return WithErrorInfo(
        absl::ResourceExhaustedError("the request is larger than this server takes"),
        "REQUEST_TOO_LARGE");
  }
  if (error == http::error::header_limit || error == http::error::buffer_overflow) {
    return WithErrorInfo(absl::ResourceExhaustedError(absl::StrCat(
                             "the request's head must have at most ", kMaxHeadBytes, " bytes")),
                         "HEADERS_TOO_LARGE");
  }
  return absl::InvalidArgumentError(absl::StrCat("not an HTTP/1.1 request: ", error.message()));
}

// True if a line of a head continues the line before it (obsolete line folding). Intermediaries may
// read it as a header of its own, so it is refused (RFC 9112 5.2).
bool HasFoldedLine(absl::string_view head) {
  return absl::StrContains(head, "\r\n ") || absl::StrContains(head, "\r\n\t");
}

class Exchange : public HttpExchange {
 public:
  Exchange(ConnectionStream* stream, boost::beast::flat_buffer* buffer,
           const HttpConnectionLimits& limits)
      : stream_(stream),
        buffer_(buffer),
        timeout_(absl::ToChronoNanoseconds(limits.request_timeout)) {
    parser_.header_limit(kMaxHeadBytes);
    parser_.body_limit(static_cast<uint64_t>(limits.max_request_bytes));
  }

  // CANCELLED: the client is gone.
  absl::Status ReadHead();

  const HttpRequest& request() const override { return request_; }
  absl::StatusOr<std::string> ReadBody() override;
  absl::Status Begin(int http_status, const HttpHeaders& headers,
                     std::optional<int64_t> content_length) override;
  absl::Status Write(absl::string_view bytes) override;
  absl::Status End() override;
  bool has_begun() const override { return http_status_ != 0; }
  bool IsWanted() const override {
    return !lost_ && !stream_->IsEnding() && !stream_->PeerIsGone();
  }

  int http_status() const { return http_status_; }
  bool CanGoOn() const { return !close_ && !lost_ && ended_; }
  bool is_lost() const { return lost_; }

 private:
  absl::Status Fill(Clock::time_point deadline);
  absl::Status FillRequest();
  absl::Status SendAll(absl::string_view bytes);

  ConnectionStream* const stream_;
  boost::beast::flat_buffer* const buffer_;
  const std::chrono::nanoseconds timeout_;
  Parser parser_;
  HttpRequest request_;
  bool head_read_ = false;
  bool expects_continue_ = false;
  std::optional<Clock::time_point> body_started_;
  int64_t body_bytes_ = 0;
  absl::Status body_error_;
  int http_status_ = 0;
  bool chunked_ = false;
  bool close_ = false;
  bool ended_ = false;
  bool lost_ = false;
};

absl::Status Exchange::Fill(Clock::time_point deadline) {
  if (buffer_->size() >= buffer_->max_size()) return ParseError(http::error::buffer_overflow);
  const auto space = buffer_->prepare(std::min(kPieceBytes, buffer_->max_size() - buffer_->size()));
  size_t count = 0;
  const Outcome outcome =
      stream_->Read(static_cast<char*>(space.data()), space.size(), deadline, &count);
  buffer_->commit(count);
  return outcome == Outcome::kDone ? absl::OkStatus() : LostConnection(outcome);
}

absl::Status Exchange::ReadHead() {
  close_ = true;  // cleared once the head proves valid
  const Clock::time_point deadline = Clock::now() + timeout_;
  while (!parser_.is_header_done()) {
    if (buffer_->size() == 0) {
      SIGHTLINE_RETURN_IF_ERROR(Fill(deadline));
    }
    error_code error;
    const size_t parsed = parser_.put(buffer_->data(), error);
    const bool is_folded =
        HasFoldedLine({static_cast<const char*>(buffer_->data().data()), parsed});
    buffer_->consume(parsed);
    if (error == http::error::need_more) {
      SIGHTLINE_RETURN_IF_ERROR(Fill(deadline));
    } else if (error) {
      return ParseError(error);
    }
    if (is_folded) {
      return absl::InvalidArgumentError(
          "not an HTTP/1.1 request: a header line begins with a blank");
    }
  }
  return FillRequest();
}

// Checks that the body has one length, on which all intermediaries agree. With a transfer coding
// that it does not know, Beast assumes no body, and the body would be read as the next request
// (RFC 9112 6.1 and 6.3: 501 for an unknown coding, 400 otherwise, and the end of the
// connection).
absl::Status CheckBodyLength(const HttpRequest& request, unsigned version, int codings) {
  const std::string length = request.Header("content-length");
  if (!std::all_of(length.begin(), length.end(), absl::ascii_isdigit)) {
    return absl::InvalidArgumentError("Content-Length: must be one number");
  }
  const auto coding = request.headers.find("transfer-encoding");
  if (coding == request.headers.end()) return absl::OkStatus();
  if (codings > 1) return absl::InvalidArgumentError("Transfer-Encoding: is given twice");
  if (version < 11) {
    return absl::InvalidArgumentError("Transfer-Encoding: HTTP/1.0 does not have it");
  }
  if (request.headers.contains("content-length")) {
    return absl::InvalidArgumentError("Transfer-Encoding: stands beside Content-Length");
  }
  if (absl::EqualsIgnoreCase(absl::StripAsciiWhitespace(coding->second), "chunked")) {
    return absl::OkStatus();
  }
  return absl::UnimplementedError("Transfer-Encoding: this server knows only \"chunked\"");
}

absl::Status Exchange::FillRequest() {
  const auto& message = parser_.get();
  request_.method = Text(message.method_string());
  request_.target = Text(message.target());
  int hosts = 0, codings = 0;
  for (const auto& field : message) {
    const std::string name = absl::AsciiStrToLower(Text(field.name_string()));
    if (name == "host") ++hosts;
    if (name == "transfer-encoding") ++codings;
    std::string& value = request_.headers[name];
    if (value.empty()) {
      value = Text(field.value());
    } else {
      absl::StrAppend(&value, ", ", Text(field.value()));
    }
  }
  SIGHTLINE_ASSIGN_OR_RETURN(request_.url, ParseRequestTarget(request_.target));
  if (hosts > 1 || (hosts == 0 && message.version() >= 11)) {
    return absl::InvalidArgumentError("the request must have one Host header");
  }
  if (!request_.url.authority.empty()) request_.headers["host"] = request_.url.authority;
  SIGHTLINE_RETURN_IF_ERROR(CheckBodyLength(request_, message.version(), codings));
  // Compressed bodies are refused: a small request could unpack to a large one.
  if (const std::string encoding = request_.Header("content-encoding");
      !encoding.empty() && !absl::EqualsIgnoreCase(encoding, "identity")) {
    return WithErrorInfo(
        absl::InvalidArgumentError("Content-Encoding: bodies must be sent as they are"),
        "MEDIA_TYPE_NOT_SUPPORTED");
  }
  request_.peer.certificate_names = stream_->PeerNames();
  const std::string authorisation = request_.Header("authorization");
  if (absl::StartsWithIgnoreCase(authorisation, "Bearer ")) {
    request_.peer.bearer_token = std::string(absl::StripAsciiWhitespace(authorisation.substr(7)));
  }
  expects_continue_ = absl::EqualsIgnoreCase(request_.Header("expect"), "100-continue");
  close_ = !message.keep_alive();
  head_read_ = true;
  return absl::OkStatus();
}

absl::StatusOr<std::string> Exchange::ReadBody() {
  if (!head_read_) return absl::InternalError("body before head");
  if (!body_error_.ok()) return body_error_;
  if (parser_.is_done()) return "";
  const auto fail = [this](absl::Status status) {
    close_ = true;
    if (absl::IsCancelled(status)) lost_ = true;
    body_error_ = status;
    return status;
  };
  if (!body_started_) {
    body_started_ = Clock::now();
    if (expects_continue_ && buffer_->size() == 0) {
      if (absl::Status status = SendAll("HTTP/1.1 100 Continue\r\n\r\n"); !status.ok()) {
        return fail(status);
      }
    }
  }
  std::string piece(kPieceBytes, '\0');
  auto& body = parser_.get().body();
  body.data = piece.data();
  body.size = piece.size();
  body.more = true;
  while (!parser_.is_done() && body.size == piece.size()) {
    error_code error = http::error::need_more;
    if (buffer_->size() > 0) buffer_->consume(parser_.put(buffer_->data(), error));
    if (error == http::error::need_more) {
      const Clock::time_point slowest =
          *body_started_ + timeout_ +
          std::chrono::milliseconds(body_bytes_ * 1000 / kMinBodyBytesPerSecond);
      const absl::Status status = Fill(std::min(Clock::now() + timeout_, slowest));
      if (!status.ok()) return fail(status);
    } else if (error && error != http::error::need_buffer) {
      return fail(ParseError(error));
    }
  }
  piece.resize(piece.size() - body.size);
  body_bytes_ += static_cast<int64_t>(piece.size());
  return piece;
}

absl::Status Exchange::SendAll(absl::string_view bytes) {
  while (!bytes.empty()) {
    const absl::string_view piece = bytes.substr(0, kPieceBytes);
    const Outcome outcome = stream_->Write(piece.data(), piece.size(), Clock::now() + timeout_);
    if (outcome != Outcome::kDone) {
      lost_ = true;
      return absl::CancelledError("the client takes no more of the answer");
    }
    bytes.remove_prefix(piece.size());
  }
  return absl::OkStatus();
}

absl::Status Exchange::Begin(int http_status, const HttpHeaders& headers,
                             std::optional<int64_t> content_length) {
  if (has_begun()) return absl::InternalError("an answer was begun twice");
  if (lost_) return absl::CancelledError("the client has gone");
  http_status_ = http_status;
  // An unread body would be read as the next request.
  if (!head_read_ || !parser_.is_done()) close_ = true;
  if (stream_->IsEnding()) close_ = true;
  const bool http_1_0 = head_read_ && parser_.get().version() < 11;
  chunked_ = !content_length && !http_1_0;
  if (!content_length && http_1_0) close_ = true;  // the end of the connection ends the body
  std::string head = absl::StrCat(
      "HTTP/1.1 ", http_status, " ",
      Text(http::obsolete_reason(static_cast<http::status>(http_status))), "\r\n",
      "Date: ", absl::FormatTime("%a, %d %b %Y %H:%M:%S GMT", absl::Now(), absl::UTCTimeZone()),
      "\r\n");
  for (const auto& [name, value] : headers) {
    std::string safe = value;
    // A line break in a value would begin another header.
    std::replace_if(
        safe.begin(), safe.end(),
        [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, ' ');
    absl::StrAppend(&head, name, ": ", safe, "\r\n");
  }
  absl::StrAppend(&head, "X-Content-Type-Options: nosniff\r\n",
                  "Cross-Origin-Resource-Policy: same-origin\r\n",
                  "Referrer-Policy: no-referrer\r\n");
  if (content_length && http_status != 204 && http_status != 304) {
    absl::StrAppend(&head, "Content-Length: ", *content_length, "\r\n");
  }
  if (chunked_) head += "Transfer-Encoding: chunked\r\n";
  if (close_) {
    head += "Connection: close\r\n";
  } else if (http_1_0) {
    head += "Connection: keep-alive\r\n";
  }
  head += "\r\n";
  return SendAll(head);
}

absl::Status Exchange::Write(absl::string_view bytes) {
  if (bytes.empty() || request_.method == "HEAD") return absl::OkStatus();
  if (!chunked_) return SendAll(bytes);
  return SendAll(absl::StrCat(absl::Hex(bytes.size()), "\r\n", bytes, "\r\n"));
}

absl::Status Exchange::End() {
  ended_ = true;
  if (!chunked_ || request_.method == "HEAD") return absl::OkStatus();
  return SendAll("0\r\n\r\n");
}

// Traceparent of the client, or a new one if it sent none.
std::string TraceparentOf(const HttpRequest& request) {
  const std::string given = ValidTraceparent(request.Header(kTraceparentKey));
  return given.empty() ? NewTraceparent() : given;
}

void LogRequest(const Exchange& exchange, Clock::time_point begin) {
  const int status = exchange.http_status();
  const auto level = status == 500   ? spdlog::level::err
                     : status >= 400 ? spdlog::level::warn
                                     : spdlog::level::debug;
  if (!spdlog::should_log(level)) return;
  spdlog::log(level, "event=http method={} target={:?} status={} duration_ms={:.3f}",
              exchange.request().method, exchange.request().target, status,
              std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
}

}  // namespace

void ServeHttpConnection(ConnectionStream* stream, const HttpConnectionLimits& limits,
                         const std::function<void(HttpExchange&)>& handle) {
  const std::chrono::nanoseconds timeout = absl::ToChronoNanoseconds(limits.request_timeout);
  boost::beast::flat_buffer buffer(2 * kPieceBytes);
  std::chrono::nanoseconds patience =
      std::min(timeout, absl::ToChronoNanoseconds(limits.first_request_timeout));
  for (;;) {
    if (buffer.size() == 0 && stream->WaitForRequest(Clock::now() + patience) != Outcome::kDone) {
      return;
    }
    patience = timeout;
    const Clock::time_point begin = Clock::now();
    Exchange exchange(stream, &buffer, limits);
    const absl::Status head = exchange.ReadHead();
    if (absl::IsCancelled(head)) return;
    const ScopedTrace trace(TraceparentOf(exchange.request()));
    if (!head.ok()) {
      ReplyError(exchange, head);
    } else {
      try {
        handle(exchange);
      } catch (const std::exception& e) {
        // An exception of a library, e.g. std::bad_alloc, must not end other clients' requests.
        spdlog::error("event=http_exception reason={:?}", e.what());
      }
      if (!exchange.has_begun() && !exchange.is_lost()) {
        ReplyError(exchange, absl::InternalError("the request could not be answered"));
      }
    }
    LogRequest(exchange, begin);
    if (exchange.CanGoOn()) continue;
    const auto linger = std::min<std::chrono::nanoseconds>(kLingerTime, timeout);
    stream->Finish(Clock::now() + (exchange.is_lost() ? std::chrono::nanoseconds(0) : linger));
    return;
  }
}

}  // namespace sightline
