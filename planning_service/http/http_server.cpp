// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/http_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/admission/shared_limit.h"
#include "core/status/status_macros.h"
#include "planning_service/http/connection_stream.h"
#include "planning_service/http/http_connection.h"
#include "planning_service/http/http_reply.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using Clock = ConnectionStream::Clock;

// At most so many connections above a limit get an answer (503) at a time; others are just closed.
constexpr int kMaxRefusals = 8;
constexpr absl::Duration kRefusalTimeout = absl::Seconds(2);
constexpr absl::Duration kStopGrace = absl::Seconds(10);

absl::Status CheckOptions(const HttpServerOptions& options) {
  if (options.max_connections < 1) {
    return absl::InvalidArgumentError("max_connections must be at least 1");
  }
  if (options.max_request_bytes < 1 || options.request_timeout <= absl::ZeroDuration() ||
      options.request_timeout > absl::Hours(24)) {
    return absl::InvalidArgumentError(
        "max_request_bytes must be positive, request_timeout in (0, 24 h]");
  }
  if (options.first_request_timeout <= absl::ZeroDuration()) {
    return absl::InvalidArgumentError("first_request_timeout must be positive");
  }
  if (options.tls.certificate.empty() != options.tls.key.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together");
  }
  if (options.tls.certificate.empty() && !options.tls.client_ca.empty()) {
    return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key");
  }
  return absl::OkStatus();
}

absl::Status TooManyConnections(const std::string& peer, const Shortage& shortage) {
  const std::string message = shortage.of_owner
                                  ? absl::StrCat(peer, " has ", shortage.held,
                                                 " connections already, which is the most allowed")
                                  : "the server has as many connections as it takes";
  return WithErrorInfo(absl::ResourceExhaustedError(message), "TOO_MANY_CONNECTIONS");
}

// Identity of the peer: its address without the port. A peer that speaks IPv4 to a socket for IPv6
// is the same peer.
std::string PeerAddress(const sockaddr_storage& address) {
  char text[INET6_ADDRSTRLEN] = "";
  if (address.ss_family == AF_INET) {
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in&>(address).sin_addr, text, sizeof(text));
  } else if (address.ss_family == AF_INET6) {
    const in6_addr& v6 = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
    if (IN6_IS_ADDR_V4MAPPED(&v6)) {
      inet_ntop(AF_INET, &v6.s6_addr[12], text, sizeof(text));
    } else {
      inet_ntop(AF_INET6, &v6, text, sizeof(text));
    }
  }
  return text;
}

// A write to a connection that the peer has closed must return an error, not end the process, but
// OpenSSL writes without MSG_NOSIGNAL. So the thread that writes, which gets SIGPIPE, blocks it.
void BlockBrokenPipeSignal() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

}  // namespace

struct HttpServer::Impl {
  Impl(const HttpServerOptions& options, ListeningSocket listening_socket,
       std::unique_ptr<TlsServerContext> tls_context)
      : listening(std::move(listening_socket)),
        tls(std::move(tls_context)),
        served(2 * int64_t{options.max_connections}, options.max_connections),
        limits{.max_request_bytes = options.max_request_bytes,
               .request_timeout = options.request_timeout,
               .first_request_timeout = options.first_request_timeout},
        stop_event(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

  struct Connection {
    Connection(FileDescriptor socket, int stop, SharedLimit::Share connection_place,
               absl::Status refusal)
        : stream(std::move(socket), stop),
          place(std::move(connection_place)),
          refused(std::move(refusal)) {}
    ConnectionStream stream;
    SharedLimit::Share place;
    const absl::Status refused;  // reason to refuse it; OK: it is served
    std::thread thread;
    bool done = false;  // guarded by the mutex below
  };

  void AcceptConnections();
  // Accepts a connection. False if the next attempt should wait.
  bool AcceptOne();
  void RemoveFinished();
  // The caller holds the mutex.
  void GiveBack(Connection* connection);
  void Serve(Connection* connection, const std::shared_ptr<SSL_CTX>& context);

  ListeningSocket listening;
  const std::unique_ptr<TlsServerContext> tls;  // null: plain
  const SharedLimit served;
  const HttpConnectionLimits limits;
  Handler handle;
  const FileDescriptor stop_event;
  std::thread acceptor;
  std::list<Connection> connections;  // for the acceptor's thread; after its end for Stop()
  // Guards the members below. A std::mutex, not an absl::Mutex: the thread sanitizer supports it
  // without a rebuilt library.
  std::mutex mutex;
  std::condition_variable ended;  // a connection has
  int refusing = 0;
};

void HttpServer::Impl::GiveBack(Connection* connection) {
  connection->place.GiveBack();
  if (!connection->refused.ok()) --refusing;
}

void HttpServer::Impl::Serve(Connection* connection, const std::shared_ptr<SSL_CTX>& context) {
  BlockBrokenPipeSignal();
  const absl::Status& refused = connection->refused;
  HttpConnectionLimits mine = limits;
  if (!refused.ok()) mine.request_timeout = std::min(mine.request_timeout, kRefusalTimeout);
  const absl::Duration patience = std::min(mine.request_timeout, mine.first_request_timeout);
  const Clock::time_point deadline = Clock::now() + absl::ToChronoNanoseconds(patience);
  if (context == nullptr ||
      connection->stream.StartTls(context.get(), deadline) == ConnectionStream::Outcome::kDone) {
    if (refused.ok()) {
      ServeHttpConnection(&connection->stream, mine, handle);
    } else {
      ServeHttpConnection(&connection->stream, mine,
                          [&](HttpExchange& exchange) { ReplyError(exchange, refused); });
    }
  }
  connection->stream.CutOff();
  const std::lock_guard lock(mutex);
  connection->done = true;
  GiveBack(connection);
  ended.notify_all();
}

void HttpServer::Impl::RemoveFinished() {
  for (auto entry = connections.begin(); entry != connections.end();) {
    bool done = false;
    {
      const std::lock_guard lock(mutex);
      done = entry->done;
    }
    if (!done) {
      ++entry;
      continue;
    }
    entry->thread.join();
    entry = connections.erase(entry);
  }
}

bool HttpServer::Impl::AcceptOne() {
  sockaddr_storage address{};
  socklen_t address_bytes = sizeof(address);
  FileDescriptor socket(accept4(listening.descriptor.get(), reinterpret_cast<sockaddr*>(&address),
                                &address_bytes, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (socket.get() < 0) {
    // Without descriptors or memory the next attempt would fail at once, too.
    return errno != EMFILE && errno != ENFILE && errno != ENOBUFS && errno != ENOMEM;
  }
  // Head and body are sent separately; the body must not wait for the acknowledgement of the head.
  const int on = 1;
  setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  RemoveFinished();
  const std::string peer = PeerAddress(address);
  SharedLimit::Share place = served.Of(peer);
  absl::Status refused;
  if (const std::optional<Shortage> shortage = place.Grow(1)) {
    refused = TooManyConnections(peer, *shortage);
    const std::lock_guard lock(mutex);
    if (refusing == kMaxRefusals) return true;  // closes it
    ++refusing;
  }
  const std::shared_ptr<SSL_CTX> context = tls == nullptr ? nullptr : tls->Current();
  Connection* connection = &connections.emplace_back(std::move(socket), stop_event.get(),
                                                     std::move(place), std::move(refused));
  try {
    connection->thread = std::thread([this, connection, context] { Serve(connection, context); });
  } catch (const std::system_error& e) {
    spdlog::warn("event=connection_dropped reason={:?}", e.what());
    {
      const std::lock_guard lock(mutex);
      GiveBack(connection);
    }
    connections.pop_back();
  }
  return true;
}

void HttpServer::Impl::AcceptConnections() {
  for (;;) {
    pollfd entries[2] = {{stop_event.get(), POLLIN, 0}, {listening.descriptor.get(), POLLIN, 0}};
    // Returns every second even without a connection, so that finished threads are joined soon.
    const int count = poll(entries, 2, /*timeout_ms=*/1000);
    if (entries[0].revents != 0) return;
    if (count == 0) RemoveFinished();
    if (count > 0 && !AcceptOne()) {
      pollfd stop{stop_event.get(), POLLIN, 0};
      poll(&stop, 1, /*timeout_ms=*/100);
    }
  }
}

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Listen(const HttpServerOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckOptions(options));
  std::unique_ptr<TlsServerContext> tls;
  if (!options.tls.certificate.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(tls,
                               TlsServerContext::Load(options.tls, options.tls_check_interval));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(ListeningSocket listening, ListenTcp(options.option, options.listen));
  auto impl = std::make_unique<Impl>(options, std::move(listening), std::move(tls));
  if (impl->stop_event.get() < 0) return absl::ResourceExhaustedError("no file descriptor is left");
  spdlog::info("event=http_listening address={} tls={}", impl->listening.address,
               impl->tls != nullptr);
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpServer::~HttpServer() { Stop(); }

const ListeningSocket& HttpServer::listening() const { return impl_->listening; }

void HttpServer::Start(Handler handle) {
  impl_->handle = std::move(handle);
  impl_->acceptor = std::thread([started = impl_.get()] { started->AcceptConnections(); });
}

void HttpServer::Stop() {
  if (!impl_->acceptor.joinable()) return;
  const uint64_t one = 1;
  // The event is never read, so that it stays readable for all threads that wait for it.
  while (write(impl_->stop_event.get(), &one, sizeof(one)) < 0 && errno == EINTR) {
  }
  impl_->acceptor.join();
  impl_->listening.descriptor = FileDescriptor();
  {
    std::unique_lock lock(impl_->mutex);
    impl_->ended.wait_for(lock, absl::ToChronoNanoseconds(kStopGrace),
                          [this] { return impl_->served.held() == 0 && impl_->refusing == 0; });
  }
  for (Impl::Connection& connection : impl_->connections) connection.stream.CutOff();
  for (Impl::Connection& connection : impl_->connections) connection.thread.join();
  impl_->connections.clear();
}

BrowserGuard MakeBrowserGuard(std::vector<std::string> names, const ListeningSocket& socket) {
  if (socket.is_loopback || !names.empty()) {
    names.insert(names.end(), {"localhost", "127.0.0.1", "[::1]", socket.host});
  }
  return BrowserGuard(std::move(names));
}

}  // namespace sightline
