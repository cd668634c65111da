// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/server_main.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <mutex>
#include <thread>

#include "core/command_options/option_values.h"
#include "core/trace/trace_context.h"
#include "rpc_server/health_check.h"

namespace sightline {
namespace {

int signal_pipe[2] = {-1, -1};

// A pipe instead of blocked signals: a blocked mask would be inherited by worker processes.
extern "C" void OnSignal(int signal) {
  const int saved_errno = errno;
  const char byte = static_cast<char>(signal);
  [[maybe_unused]] const ssize_t written = write(signal_pipe[1], &byte, 1);
  errno = saved_errno;
}

bool InstallSignalHandlers() {
  if (pipe2(signal_pipe, O_CLOEXEC | O_NONBLOCK) != 0) return false;
  struct sigaction action {};
  action.sa_handler = OnSignal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
  // Then a write beyond the limit on file sizes fails (EFBIG) like one on a full disk.
  signal(SIGXFSZ, SIG_IGN);
  return true;
}

enum class StopCause { kSignal, kParentGone, kTimeout };

// Waits for a signal or for the end of the parent, which holds the other end of `parent_fd`.
StopCause WaitForStop(int parent_fd, absl::Duration timeout = absl::InfiniteDuration()) {
  const auto start = std::chrono::steady_clock::now();
  while (true) {
    int wait_ms = -1;
    if (timeout != absl::InfiniteDuration()) {
      const absl::Duration left =
          timeout - absl::FromChrono(std::chrono::steady_clock::now() - start);
      if (left <= absl::ZeroDuration()) return StopCause::kTimeout;
      wait_ms = static_cast<int>(absl::ToInt64Milliseconds(left)) + 1;
    }
    pollfd fds[2] = {{signal_pipe[0], POLLIN, 0}, {parent_fd, POLLIN, 0}};
    if (poll(fds, parent_fd >= 0 ? 2 : 1, wait_ms) <= 0) continue;
    char byte;
    if ((fds[0].revents & POLLIN) != 0 && read(signal_pipe[0], &byte, 1) == 1) {
      return StopCause::kSignal;
    }
    if (parent_fd >= 0 && fds[1].revents != 0 && read(parent_fd, &byte, 1) <= 0 && errno != EINTR) {
      return StopCause::kParentGone;
    }
  }
}

// Writes "trace_id=... " of the thread's request; nothing if the thread works on none.
class TraceFlag final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg&, const std::tm&,
              spdlog::memory_buf_t& line) override {
    const std::string_view trace_id = TraceIdOf(CurrentTraceparent());
    if (trace_id.empty()) return;
    for (const std::string_view part :
         {std::string_view("trace_id="), trace_id, std::string_view(" ")}) {
      line.append(part.data(), part.data() + part.size());
    }
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return spdlog::details::make_unique<TraceFlag>();
  }
};

void StartLogging(const std::string& name, const std::string& level) {
  auto logger = spdlog::stderr_logger_mt(name);
  // All fields are key=value, so that programs can read them.
  auto formatter = std::make_unique<spdlog::pattern_formatter>(spdlog::pattern_time_type::utc);
  formatter->add_flag<TraceFlag>('*').set_pattern(
      "time=%Y-%m-%dT%H:%M:%S.%eZ level=%l pid=%P %*%v");
  logger->set_formatter(std::move(formatter));
  logger->set_level(spdlog::level::from_str(level));
  logger->flush_on(spdlog::level::debug);
  spdlog::set_default_logger(std::move(logger));
}

// Every connection is a descriptor; the usual limit of 1024 is for programs that use select().
void AllowManyConnections() {
  constexpr rlim_t kDescriptors = 65536;
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = std::max(limit.rlim_cur, std::min(limit.rlim_max, kDescriptors));
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

void AddBytesOption(CLI::App& app, const char* name, int64_t* value, const char* help) {
  CLI::Option* const option = app.add_option(name, *value, help);
  option->check(CLI::Range(1.0, 1e15))->capture_default_str();
  TakeSizes(*option);
}

int ServerMain(int argc, char** argv, const ServerProgram& program, RpcServerOptions* options) {
  if (const std::optional<int> code = MaybeCheckHealth(argc, argv)) return *code;
  options->metrics_port = 0;
  double drain_seconds = 30;
  double idle_timeout_s = absl::ToDoubleSeconds(options->idle_timeout);
  int parent_fd = -1;
  std::string log_level = "info";
  CLI::App app(program.description, program.name);
  if (!program.version.empty()) app.set_version_flag("--version", program.version);
  app.add_option("--listen", options->listen, "unix:PATH or HOST:PORT (port 0: any free one)")
      ->required();
  program.add_options(app);
  app.add_option("--max-call-threads", options->max_call_threads,
                 "Calls at a time, streams included; more get RESOURCE_EXHAUSTED")
      ->check(CLI::Range(8, 4096))
      ->capture_default_str();
  app.add_option("--peer-share", options->peer_share,
                 "Share of the calls and streams that one peer may have open; 1 behind a proxy")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--idle-timeout-seconds", idle_timeout_s,
                 "How long a stream may wait for its client before it is ended")
      ->check(CLI::Range(0.1, 86400.0))
      ->capture_default_str();
  app.add_option("--metrics-port", options->metrics_port, "Prometheus metrics at /metrics; 0: off")
      ->check(CLI::Range(0, 65535));
  app.add_option("--metrics-host", options->metrics_host, "Address to serve metrics on")
      ->capture_default_str();
  app.add_flag("--allow-plaintext", options->allow_plaintext,
               "Let other machines reach the server without TLS, and its metrics");
  app.add_option("--drain-seconds", drain_seconds,
                 "How long running calls may take to finish on SIGTERM")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  app.add_option(
      "--tls-cert", options->tls_certificate_file,
      "PEM certificate chain; turns on TLS. Read again when it changes, like the two below");
  app.add_option("--tls-key", options->tls_key_file, "PEM private key");
  app.add_option("--tls-client-ca", options->tls_client_ca_file,
                 "PEM; clients must show a certificate of it (mTLS)");
  app.add_option("--log-level", log_level, "Least level logged to stderr; debug logs all calls")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str();
  app.add_option("--parent-fd", parent_fd,
                 "Read end of a pipe; the server ends when its other end is closed");
  std::string ignored;  // MaybeCheckHealth has read it; here for --help
  app.add_option("--health-check", ignored,
                 "Ask the server at this address whether it serves, and end: exit code 0 if so. "
                 "With --tls-cert and --tls-key by TLS");
  app.add_option("--health-service", ignored,
                 "With --health-check: whether this service takes more work, e.g. "
                 "sightline.v1.CoverageService; default: whether the server is alive");
  NeedOption(app, {"--health-service"}, "--health-check");
  NeedOption(app, {"--metrics-host"}, "--metrics-port");
  RequireStrictNumbers(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  options->idle_timeout = absl::Seconds(idle_timeout_s);
  if (options->metrics_port == 0) options->metrics_port = -1;
  if (parent_fd >= 0 && fcntl(parent_fd, F_SETFD, FD_CLOEXEC) != 0) {
    std::fprintf(stderr, "--parent-fd %d: not an open file descriptor\n", parent_fd);
    return 2;
  }

  StartLogging(program.name, log_level);
  AllowManyConnections();
  if (!InstallSignalHandlers()) {
    std::fprintf(stderr, "%s: cannot make a pipe\n", program.name.c_str());
    return 1;
  }
  absl::StatusOr<std::unique_ptr<RunningServer>> server = program.start();
  if (!server.ok()) {
    std::fprintf(stderr, "%s: %s\n", program.name.c_str(),
                 std::string(server.status().message()).c_str());
    return absl::IsInvalidArgument(server.status()) ? 2 : 1;
  }
  std::printf("listening on %s\n", (*server)->address().c_str());
  std::fflush(stdout);

  const StopCause cause = WaitForStop(parent_fd);
  // If the parent process is gone, nobody waits for answers.
  const absl::Duration grace =
      cause == StopCause::kParentGone ? absl::ZeroDuration() : absl::Seconds(drain_seconds);
  // Ends the process at a second signal, or if work does not stop on request. Once the drain is
  // over, the lock stays held, so that the thread does not touch the server any more. Lock and
  // thread outlive this function.
  static std::timed_mutex server_exists;
  RunningServer* const running = server->get();
  const absl::Duration hard_stop = grace + program.stop_within;
  std::thread impatience([=, fd = cause == StopCause::kParentGone ? -1 : parent_fd] {
    if (WaitForStop(fd, hard_stop) == StopCause::kTimeout) {
      spdlog::warn("event=stopped_hard after_s={:.1f}", absl::ToDoubleSeconds(hard_stop));
    }
    if (server_exists.try_lock_for(std::chrono::seconds(1))) running->Abandon();
    std::_Exit(0);
  });
  impatience.detach();
  (*server)->Drain(grace);
  server_exists.lock();
  server->reset();
  spdlog::shutdown();
  return 0;
}

}  // namespace sightline
