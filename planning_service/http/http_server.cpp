// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/http_server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <list>
#include <system_error>
#include <thread>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "planning_service/http/connection_stream.h"
#include "planning_service/http/http_connection.h"
#include "planning_service/http/http_reply.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using Clock = ConnectionStream::Clock;

// Connections above the limit that are told so at a time; what comes then is closed without a word.
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
  if (options.tls.certificate.empty() != options.tls.key.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together");
  }
  if (options.tls.certificate.empty() && !options.tls.client_ca.empty()) {
    return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key");
  }
  return absl::OkStatus();
}

void RefuseConnection(HttpExchange& exchange) {
  ReplyError(
      exchange,
      WithErrorInfo(absl::ResourceExhaustedError("the server has as many connections as it takes"),
                    "TOO_MANY_CONNECTIONS"));
}

// Writing to a connection that the peer has closed must give an error, not end the process; OpenSSL
// writes without MSG_NOSIGNAL. The signal goes to the thread that writes.
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
        max_connections(options.max_connections),
        limits{.max_request_bytes = options.max_request_bytes,
               .request_timeout = options.request_timeout},
        stop_event(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

  struct Connection {
    Connection(FileDescriptor socket, int stop) : stream(std::move(socket), stop) {}
    ConnectionStream stream;
    std::thread thread;
    bool done = false;  // guarded by the mutex below
  };

  void AcceptConnections();
  // Whether accepting should go on at once.
  bool AcceptOne();
  void RemoveFinished();
  void Serve(Connection* connection, const std::shared_ptr<SSL_CTX>& context, bool refuse);

  ListeningSocket listening;
  const std::unique_ptr<TlsServerContext> tls;  // null: plain
  const int max_connections;
  const HttpConnectionLimits limits;
  Handler handle;
  const FileDescriptor stop_event;
  std::thread acceptor;
  std::list<Connection> connections;  // of the acceptor; of Stop() once that has ended
  absl::Mutex mutex;
  int running ABSL_GUARDED_BY(mutex) = 0;
};

void HttpServer::Impl::Serve(Connection* connection, const std::shared_ptr<SSL_CTX>& context,
                             bool refuse) {
  BlockBrokenPipeSignal();
  HttpConnectionLimits mine = limits;
  if (refuse) mine.request_timeout = std::min(mine.request_timeout, kRefusalTimeout);
  const Clock::time_point deadline = Clock::now() + absl::ToChronoNanoseconds(mine.request_timeout);
  if (context == nullptr ||
      connection->stream.StartTls(context.get(), deadline) == ConnectionStream::Outcome::kDone) {
    if (refuse) {
      ServeHttpConnection(&connection->stream, mine, RefuseConnection);
    } else {
      ServeHttpConnection(&connection->stream, mine, handle);
    }
  }
  connection->stream.CutOff();
  absl::MutexLock lock(&mutex);
  connection->done = true;
  --running;
}

void HttpServer::Impl::RemoveFinished() {
  for (auto entry = connections.begin(); entry != connections.end();) {
    bool done = false;
    {
      absl::MutexLock lock(&mutex);
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
  FileDescriptor socket(
      accept4(listening.descriptor.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (socket.get() < 0) {
    // Without descriptors or memory the next attempt would fail at once, too.
    return errno != EMFILE && errno != ENFILE && errno != ENOBUFS && errno != ENOMEM;
  }
  // Heads and bodies are sent apart; the second must not wait for an acknowledgement of the first.
  const int on = 1;
  setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  RemoveFinished();
  int now = 0;
  {
    absl::MutexLock lock(&mutex);
    if (running >= max_connections + kMaxRefusals) return true;  // closes it
    now = ++running;
  }
  const std::shared_ptr<SSL_CTX> context = tls == nullptr ? nullptr : tls->Current();
  Connection* connection = &connections.emplace_back(std::move(socket), stop_event.get());
  try {
    connection->thread = std::thread([this, connection, context, refuse = now > max_connections] {
      Serve(connection, context, refuse);
    });
  } catch (const std::system_error& e) {
    spdlog::warn("event=connection_dropped reason={:?}", e.what());
    connections.pop_back();
    absl::MutexLock lock(&mutex);
    --running;
  }
  return true;
}

void HttpServer::Impl::AcceptConnections() {
  for (;;) {
    pollfd entries[2] = {{stop_event.get(), POLLIN, 0}, {listening.descriptor.get(), POLLIN, 0}};
    // Now and then without a connection, so that finished threads do not wait for the next one.
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
  if (absl::Status status = CheckOptions(options); !status.ok()) return status;
  std::unique_ptr<TlsServerContext> tls;
  if (!options.tls.certificate.empty()) {
    absl::StatusOr<std::unique_ptr<TlsServerContext>> loaded =
        TlsServerContext::Load(options.tls, options.tls_check_interval);
    if (!loaded.ok()) return loaded.status();
    tls = *std::move(loaded);
  }
  absl::StatusOr<ListeningSocket> listening = ListenTcp(options.option, options.listen);
  if (!listening.ok()) return listening.status();
  auto impl = std::make_unique<Impl>(options, *std::move(listening), std::move(tls));
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
  // Never read: it stays readable for everybody who waits for it.
  while (write(impl_->stop_event.get(), &one, sizeof(one)) < 0 && errno == EINTR) {
  }
  impl_->acceptor.join();
  impl_->listening.descriptor = FileDescriptor();
  {
    absl::MutexLock lock(&impl_->mutex);
    const auto idle = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(impl_->mutex) {
      return impl_->running == 0;
    };
    impl_->mutex.AwaitWithTimeout(absl::Condition(&idle), kStopGrace);
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
