// SPDX-License-Identifier: Apache-2.0
// Shapes of requests on which the programs of a chain could disagree about where a body ends
// (request smuggling), after RFC 9110, RFC 9112 and public collections of smuggling variants.
//
// Each shape is sent over a connection of its own, followed by a second request. What is refused
// must end the connection, so that nothing behind it is taken for a request; what is taken must
// give exactly the body that the standard says and then the second request.
#include <gtest/gtest.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "planning_service/http/http_reply.h"
#include "planning_service/http/http_server.h"
#include "tests/planning_service/http_api/raw_connection.h"

namespace sightline {
namespace {

constexpr char kNext[] = "GET /next HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n";

// A body that is refused for its size is no question of framing: larger than all here.
constexpr int64_t kMaxRequestBytes = 100'000;

struct Shape {
  std::string name;
  std::string bytes;
  // Status of the first answer.
  int status = 0;
  // Requests that reach the handler before the second one: "METHOD TARGET BODY".
  std::vector<std::string> seen;
};

// Shapes whose first request is refused, by what stands instead of its parts.
class ShapeTable {
 public:
  // A chunked body, with this header instead of "Transfer-Encoding: chunked".
  void Coding(const std::string& header, int status) {
    Add(header,
        absl::StrCat("POST / HTTP/1.1\r\nHost: a\r\n", header, "\r\n\r\n5\r\nhello\r\n",
                     "0\r\n\r\n"),
        status, "POST / hello");
  }
  // Five bytes of body, with this header instead of "Content-Length: 5".
  void Length(const std::string& header, int status) {
    Add(header, absl::StrCat("POST / HTTP/1.1\r\nHost: a\r\n", header, "\r\n\r\nhello"), status,
        "POST / hello");
  }
  // A chunked body that ends with `chunks`.
  void Chunks(const std::string& chunks, int status, const std::string& body) {
    Add(chunks,
        absl::StrCat("POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n", chunks),
        status, absl::StrCat("POST / ", body));
  }
  // A request without a body of this line and these headers.
  void Head(const std::string& head, int status, const std::string& seen = "GET / ") {
    Add(head, absl::StrCat(head, "\r\n\r\n"), status, seen);
  }
  void Add(const std::string& name, const std::string& bytes, int status, const std::string& seen) {
    Shape shape{Printable(name), bytes, status, {}};
    if (status == 200) shape.seen = {seen};
    shapes_.push_back(std::move(shape));
  }
  const std::vector<Shape>& shapes() const { return shapes_; }

 private:
  static std::string Printable(const std::string& text) {
    return absl::StrReplaceAll(
        text, {{"\r", "\\r"}, {"\n", "\\n"}, {"\t", "\\t"}, {std::string(1, '\0'), "\\0"}});
  }
  std::vector<Shape> shapes_;
};

std::string WithByte(const std::string& before, char byte, const std::string& after) {
  return before + byte + after;
}

std::vector<Shape> AllShapes() {
  ShapeTable table;
  const std::string te = "Transfer-Encoding: ";

  // --- transfer codings (RFC 9112 6.1, 7) --------------------------------------------------------
  for (const char* header :
       {"Transfer-Encoding: chunked", "transfer-encoding: chunked", "TRANSFER-ENCODING: CHUNKED",
        "Transfer-Encoding: Chunked", "Transfer-Encoding:chunked", "Transfer-Encoding:  chunked",
        "Transfer-Encoding:\tchunked", "Transfer-Encoding: chunked ",
        "Transfer-Encoding: chunked\t"}) {
    table.Coding(header, 200);
  }
  for (const char* value : {"xchunked",
                            "chunkedx",
                            "gzip",
                            "deflate",
                            "compress",
                            "identity",
                            "br",
                            "x-chunked",
                            "gzip, chunked",
                            "gzip,chunked",
                            "chunked, gzip",
                            "chunked, identity",
                            "identity, chunked",
                            "chunked, chunked",
                            "chunked,",
                            ",chunked",
                            ", chunked",
                            ",",
                            "\"chunked\"",
                            "'chunked'",
                            "chunked;q=1",
                            "chunked;foo=bar",
                            "chunked foo",
                            "foo chunked",
                            "[chunked]",
                            "chunked\\",
                            "ch unked",
                            "cow",
                            "cow, chunked",
                            "chunk",
                            "hunked",
                            ""}) {
    table.Coding(te + value, 501);
  }
  // Control characters, and a byte beyond ASCII, in the value.
  for (const char byte : {'\0', '\x01', '\x0b', '\x0c', '\x1f', '\x7f'}) {
    table.Coding(WithByte(te, byte, "chunked"), 400);
    table.Coding(WithByte(te + "chunked", byte, ""), 400);
  }
  table.Coding(te + "\xa0"
                    "chunked",
               501);
  table.Coding(te + "chunked\xff", 501);
  // Several headers of the name.
  for (const char* second : {"chunked", "identity", "gzip", "cow", ""}) {
    table.Coding(te + "chunked\r\n" + te + second, 400);
    table.Coding(te + second + "\r\n" + te + "chunked", 400);
  }
  // Names that are none.
  for (const char* header :
       {"Transfer-Encoding : chunked", "Transfer-Encoding\t: chunked",
        " Transfer-Encoding: chunked", "\tTransfer-Encoding: chunked", "Transfer Encoding: chunked",
        "Transfer-Encoding", "Transfer-Encoding=chunked", ": chunked",
        "\"Transfer-Encoding\": chunked", "Transfer-Encoding:: chunked"}) {
    table.Coding(header, std::string(header).ends_with(":: chunked") ? 501 : 400);
  }
  for (const char byte : {'\0', '\x01', '\x0b', '\x7f', '\xa0'}) {
    table.Coding(WithByte("Transfer-Encoding", byte, ": chunked"), 400);
    table.Coding(WithByte("", byte, "Transfer-Encoding: chunked"), 400);
  }
  // Both lengths (RFC 9112 6.1: an error, whichever comes first).
  for (const char* length :
       {"Content-Length: 5", "Content-Length: 0", "Content-Length: 15", "content-length: 99999"}) {
    table.Coding(absl::StrCat(te, "chunked\r\n", length), 400);
    table.Coding(absl::StrCat(length, "\r\n", te, "chunked"), 400);
    table.Coding(absl::StrCat(length, "\r\n", te, "xchunked"), 400);
  }
  table.Add("HTTP/1.0 with a transfer coding",
            "POST / HTTP/1.0\r\nHost: a\r\nTransfer-Encoding: chunked\r\nConnection: keep-alive"
            "\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
            400, "");

  // --- lengths (RFC 9112 6.3, RFC 9110 8.6) ------------------------------------------------------
  for (const char* header :
       {"Content-Length: 5", "content-length:5", "CONTENT-LENGTH:  5 ", "Content-Length:\t5\t",
        "Content-Length: 05", "Content-Length: 0005"}) {
    table.Length(header, 200);
  }
  for (const char* value : {"+5",
                            "-5",
                            "0x5",
                            "5.0",
                            "5e0",
                            "5 5",
                            "5,5",
                            "5, 5",
                            "5;5",
                            "five",
                            "\"5\"",
                            "'5'",
                            "",
                            "5a",
                            "a5",
                            "\xb5",
                            "18446744073709551621",
                            "4294967301x",
                            "99999999999999999999999",
                            "-1",
                            "- 5",
                            "0b101",
                            "5 ,",
                            ",5",
                            "5\t5"}) {
    table.Length(absl::StrCat("Content-Length: ", value), 400);
  }
  for (const char byte : {'\0', '\x0b', '\x7f'}) {
    table.Length(WithByte("Content-Length: ", byte, "5"), 400);
    table.Length(WithByte("Content-Length: 5", byte, ""), 400);
  }
  for (const char* second : {"4", "6", "0", "", "x"}) {
    table.Length(absl::StrCat("Content-Length: 5\r\nContent-Length: ", second), 400);
    table.Length(absl::StrCat("Content-Length: ", second, "\r\nContent-Length: 5"), 400);
  }
  for (const char* header : {"Content-Length : 5", " Content-Length: 5", "Content-Length\t: 5",
                             "Content Length: 5", "Content-Length", "\tContent-Length: 5"}) {
    table.Length(header, 400);
  }

  // --- chunks (RFC 9112 7.1) ---------------------------------------------------------------------
  for (const char* chunks : {"5\r\nhello\r\n0\r\n\r\n", "05\r\nhello\r\n0\r\n\r\n",
                             "2\r\nhe\r\n3\r\nllo\r\n0\r\n\r\n", "5;a=b\r\nhello\r\n0\r\n\r\n",
                             "5;a=\"b\"\r\nhello\r\n0\r\n\r\n", "5\r\nhello\r\n00\r\n\r\n",
                             "5\r\nhello\r\n0;last\r\n\r\n", "5\r\nhello\r\n0\r\nX: y\r\n\r\n"}) {
    table.Chunks(chunks, 200, "hello");
  }
  table.Chunks("0\r\n\r\n", 200, "");
  table.Chunks("A\r\nhellohello\r\n0\r\n\r\n", 200, "hellohello");
  table.Chunks("a\r\nhellohello\r\n0\r\n\r\n", 200, "hellohello");
  for (const char* chunks : {"0x5\r\nhello\r\n0\r\n\r\n",
                             "+5\r\nhello\r\n0\r\n\r\n",
                             "-5\r\nhello\r\n0\r\n\r\n",
                             " 5\r\nhello\r\n0\r\n\r\n",
                             "5 5\r\nhello\r\n0\r\n\r\n",
                             "5\nhello\n0\n\n",
                             "5\r\nhello0\r\n\r\n",
                             "5\r\nhello!\r\n0\r\n\r\n",
                             "5\r\nhell\r\n0\r\n\r\n",
                             "\r\nhello\r\n0\r\n\r\n",
                             "g\r\nhello\r\n0\r\n\r\n",
                             "5,\r\nhello\r\n0\r\n\r\n",
                             "10000000000000005\r\nhello\r\n0\r\n\r\n",
                             "FFFFFFFFFFFFFFFFF\r\nhello\r\n0\r\n\r\n",
                             "5\r\rhello\r\n0\r\n\r\n",
                             "5\rhello\r\n0\r\n\r\n",
                             "5\r\nhello\n0\r\n\r\n",
                             "5\r\nhello\r0\r\n\r\n",
                             "5\n\nhello\r\n0\r\n\r\n",
                             "5.\r\nhello\r\n0\r\n\r\n",
                             "5;a\nb\r\nhello\r\n0\r\n\r\n",
                             "\"5\"\r\nhello\r\n0\r\n\r\n",
                             "5\r\nhello\r\n-0\r\n\r\n",
                             "5\r\nhello\r\n0\r\n X: y\r\n\r\n",
                             "5\r\nhello\r\n0\r\nX : y\r\n\r\n",
                             "5\r\nhello\r\n0\r\nContent-Length: 9\r\n\r\n",
                             "5\r\nhello\r\n0\r\nTransfer-Encoding: chunked\r\n\r\n"}) {
    table.Chunks(chunks, 400, "");
  }

  // --- request line and host (RFC 9112 3, 3.2) ---------------------------------------------------
  table.Head("GET / HTTP/1.1\r\nHost: a", 200);
  table.Head("GET /a%20b HTTP/1.1\r\nHost: a", 200, "GET /a%20b ");
  for (const char* head : {"GET  / HTTP/1.1\r\nHost: a",
                           "GET /  HTTP/1.1\r\nHost: a",
                           "GET\t/ HTTP/1.1\r\nHost: a",
                           "GET /\tHTTP/1.1\r\nHost: a",
                           " GET / HTTP/1.1\r\nHost: a",
                           "GET / HTTP/1.1 \r\nHost: a",
                           "GET / http/1.1\r\nHost: a",
                           "GET / HTTP/1.10\r\nHost: a",
                           "GET / HTTP/01.1\r\nHost: a",
                           "GET / HTTP/1.\r\nHost: a",
                           "GET / HTTP/2.0\r\nHost: a",
                           "GET / HTTP/1,1\r\nHost: a",
                           "GET /\r\nHost: a",
                           "GET\r\nHost: a",
                           "/ HTTP/1.1\r\nHost: a",
                           "GET HTTP/1.1\r\nHost: a",
                           "GET /a b HTTP/1.1\r\nHost: a",
                           "GET / HTTP/1.1 x\r\nHost: a",
                           "G@T / HTTP/1.1\r\nHost: a",
                           "GET / HTTP/1.1\nHost: a",
                           "GET / HTTP/1.1\r\nHost: a\nX: y",
                           "GET / HTTP/1.1\rHost: a",
                           "GET / HTTP/1.1\r\nHost: a\r\nHost: a",
                           "GET / HTTP/1.1\r\nHost: a\r\nHost: b",
                           "GET / HTTP/1.1",
                           "GET / HTTP/1.1\r\nX: y",
                           "GET / HTTP/1.1\r\nHost : a",
                           "GET / HTTP/1.1\r\n Host: a",
                           "GET / HTTP/1.1\r\nHost: a\r\n: y",
                           "GET / HTTP/1.1\r\nHost: a\r\nX",
                           "GET / HTTP/1.1\r\nHost: a\r\nX y: z"}) {
    table.Head(head, 400);
  }
  for (const char byte : {'\0', '\x01', '\x7f'}) {
    table.Head(WithByte("GET /a", byte, " HTTP/1.1\r\nHost: a"), 400);
    table.Head(WithByte("GET / HTTP/1.1\r\nHost: a\r\nX: y", byte, "z"), 400);
    table.Head(WithByte("GET / HTTP/1.1\r\nHost: a\r\nX", byte, ": z"), 400);
  }
  return table.shapes();
}

class RequestShapes : public testing::Test {
 protected:
  void SetUp() override {
    HttpServerOptions options;
    options.listen = "127.0.0.1:0";
    options.max_request_bytes = kMaxRequestBytes;
    auto server = HttpServer::Listen(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    const std::string& address = server_->listening().address;
    ASSERT_TRUE(absl::SimpleAtoi(address.substr(address.rfind(':') + 1), &port_));
    server_->Start([this](HttpExchange& exchange) { Answer(exchange); });
  }

  void Answer(HttpExchange& exchange) {
    std::string body;
    while (true) {
      const absl::StatusOr<std::string> piece = exchange.ReadBody();
      if (!piece.ok()) return ReplyError(exchange, piece.status());
      if (piece->empty()) break;
      body += *piece;
    }
    {
      std::lock_guard lock(mutex_);
      seen_.push_back(
          absl::StrCat(exchange.request().method, " ", exchange.request().target, " ", body));
    }
    ReplyText(exchange, 200, {}, "text/plain", "well\n");
  }

  std::vector<std::string> TakeSeen() {
    std::lock_guard lock(mutex_);
    return std::exchange(seen_, {});
  }

  std::unique_ptr<HttpServer> server_;
  int port_ = 0;
  std::mutex mutex_;
  std::vector<std::string> seen_;  // by mutex_
};

TEST_F(RequestShapes, HaveOneMeaningOrNone) {
  const std::vector<Shape> shapes = AllShapes();
  EXPECT_GE(shapes.size(), 150u);
  for (const Shape& shape : shapes) {
    RawConnection connection(port_);
    ASSERT_TRUE(connection.connected());
    connection.Send(shape.bytes + kNext);
    const std::string answers = connection.ReadAll();
    std::vector<std::string> expected = shape.seen;
    if (!expected.empty()) expected.push_back("GET /next ");
    EXPECT_EQ(TakeSeen(), expected) << shape.name;
    EXPECT_EQ(answers.substr(0, 13), absl::StrCat("HTTP/1.1 ", shape.status, " "))
        << shape.name << "\n"
        << answers.substr(0, 400);
  }
}

}  // namespace
}  // namespace sightline
