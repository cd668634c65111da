// SPDX-License-Identifier: Apache-2.0
#include "planner_client/embedded_server/embedded_server.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <sstream>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "core/process/process_clock.h"
#include "core/process/program_path.h"
#include "core/process/start_process.h"
#include "core/process_folder/process_folder.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxSocketPathBytes = 107;
constexpr size_t kStderrTailBytes = 2000;

absl::StatusOr<std::string> FindBinary(const EmbeddedServerOptions& options) {
  const fs::path path =
      options.binary.empty() ? FindProgram(options.program) : fs::path(options.binary);
  if (access(path.c_str(), X_OK) != 0) {
    return absl::NotFoundError(absl::StrCat(options.description, ": no executable ", path.string(),
                                            "; install the package sightline-",
                                            absl::StrReplaceAll(options.program, {{"_", "-"}}),
                                            ", or in a source folder run deploy/add-program ",
                                            options.program == "render_worker" ? "render" : "plan",
                                            ", or give the address of a running one"));
  }
  return path.string();
}

absl::StatusOr<ProcessFolder> MakePrivateFolder() {
  std::string base = TemporaryBase();
  if (base.size() + 40 > kMaxSocketPathBytes) base = "/tmp";
  return ProcessFolder::Make(base, "sightline-server");
}

std::string DescribeEnd(int wait_status) {
  if (WIFSIGNALED(wait_status)) {
    const int number = WTERMSIG(wait_status);
    return absl::StrCat("was killed by signal ", number, " (", strsignal(number), ")");
  }
  return absl::StrCat("ended with exit code ", WEXITSTATUS(wait_status));
}

class ScopedFd {
 public:
  ScopedFd() = default;
  explicit ScopedFd(int fd) : fd_(fd) {}
  ~ScopedFd() { Reset(); }
  ScopedFd(const ScopedFd&) = delete;
  ScopedFd& operator=(const ScopedFd&) = delete;
  ScopedFd& operator=(ScopedFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ScopedFd(ScopedFd&& other) noexcept { std::swap(fd_, other.fd_); }
  int get() const { return fd_; }
  void Reset() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }

 private:
  int fd_ = -1;
};

struct Pipe {
  ScopedFd read;
  ScopedFd write;
};

absl::StatusOr<Pipe> MakePipe() {
  int fds[2];
  // Close-on-exec: no other child may keep the server's lifeline open.
  if (pipe2(fds, O_CLOEXEC) != 0) {
    return absl::InternalError(absl::StrCat("pipe: ", std::strerror(errno)));
  }
  return Pipe{ScopedFd(fds[0]), ScopedFd(fds[1])};
}

class EmbeddedServerImpl final : public EmbeddedServer {
 public:
  EmbeddedServerImpl(EmbeddedServerOptions options, std::string binary, ProcessFolder folder)
      : options_(std::move(options)),
        binary_(std::move(binary)),
        owned_folder_(std::move(folder)),
        folder_(owned_folder_.path()),
        address_(absl::StrCat("unix:", folder_, "/server.sock")) {}

  ~EmbeddedServerImpl() override {
    std::lock_guard lock(mutex_);
    Stop();
  }

  const std::string& address() const override { return address_; }

  const std::string& folder() const override { return folder_; }

  int pid() const override {
    std::lock_guard lock(mutex_);
    return pid_;
  }

  absl::Status CheckAlive() override {
    std::lock_guard lock(mutex_);
    return CheckAliveLocked();
  }

  absl::Status Restart() override {
    std::lock_guard lock(mutex_);
    absl::Status ended = CheckAliveLocked();
    if (ended.ok()) return ended;
    if (restarted_) {
      return absl::UnavailableError(
          absl::StrCat(ended.message(), "\n(it was restarted once before)"));
    }
    restarted_ = true;
    std::fprintf(stderr, "%s\nIt is being restarted.\n", std::string(ended.message()).c_str());
    return Launch(/*keeps_on=*/Interrupted());
  }

  absl::Status Start() {
    absl::Status launched = Launch(/*keeps_on=*/false);
    return !launched.ok() && was_killed_at_start_ ? Restart() : launched;
  }

  // `keeps_on`: continue in spite of an interruption.
  absl::Status Launch(bool keeps_on) {
    SIGHTLINE_ASSIGN_OR_RETURN(Pipe lifeline, MakePipe());
    SIGHTLINE_ASSIGN_OR_RETURN(Pipe output, MakePipe());

    constexpr int kLifelineFd = 3;
    std::vector<std::string> arguments = {
        binary_,       "--listen", address_, "--parent-fd", absl::StrCat(kLifelineFd),
        "--log-level", "warning"};
    // Its files go to TMPDIR also if that is too long for a socket.
    const std::string base = TemporaryBase();
    const std::string& files =
        std::filesystem::path(folder_).parent_path() == std::filesystem::path(base) ? folder_
                                                                                    : base;
    for (const std::string& argument : options_.arguments) {
      arguments.push_back(absl::StrReplaceAll(argument, {{"{folder}", files}}));
    }
    const absl::StatusOr<pid_t> child = StartProcess(
        {.words = std::move(arguments),
         .descriptors = {
             {.number = 1, .ours = output.write.get()},
             {.number = 2, .file = StderrFile(), .flags = O_WRONLY | O_CREAT | O_TRUNC | O_APPEND},
             {.number = kLifelineFd, .ours = lifeline.read.get()}}});
    if (!child.ok()) {
      return absl::UnavailableError(
          absl::StrCat(options_.description, ": ", child.status().message()));
    }
    pid_ = *child;
    wait_status_.reset();
    lifeline_ = std::move(lifeline.write);
    output.write.Reset();
    absl::Status status = WaitUntilListening(output.read.get(), keeps_on);
    was_killed_at_start_ = !status.ok() && wait_status_ && WIFSIGNALED(*wait_status_);
    if (!status.ok()) Stop();
    return status;
  }

 private:
  // Returns the end of `timeout` from now, on a monotonic clock.
  static std::chrono::steady_clock::time_point Deadline(absl::Duration timeout) {
    return std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(timeout);
  }

  bool Interrupted() const { return options_.interrupted != nullptr && *options_.interrupted; }

  // Limits: `start_limit`; the end of the process or of its stdout; an interruption, unless
  // `keeps_on`.
  absl::Status WaitUntilListening(int output_fd, bool keeps_on) {
    const auto notice_at = Deadline(options_.start_notice);
    bool noticed = false;
    ProcessClock clock(pid_);
    std::string text;
    while (!absl::StrContains(text, "listening on ")) {
      if (Interrupted() && !keeps_on) {
        return absl::CancelledError(
            absl::StrCat("interrupted while the ", options_.description, " was starting"));
      }
      if (clock.Look() > options_.start_limit) {
        return absl::DeadlineExceededError(absl::StrCat(
            options_.description, " ", binary_, " did not listen within ",
            absl::FormatDuration(options_.start_limit), " of its own time", StderrTail()));
      }
      if (!noticed && std::chrono::steady_clock::now() >= notice_at) {
        noticed = true;
        PrintNotice();
      }
      pollfd fd = {output_fd, POLLIN, 0};
      const auto wait_ms = static_cast<int>(absl::ToInt64Milliseconds(ProcessClock::kPeriod));
      if (poll(&fd, 1, wait_ms) <= 0) {
        // A child of its own may keep its stdout open.
        SIGHTLINE_RETURN_IF_ERROR(CheckAliveLocked());
        continue;
      }
      char buffer[512];
      const ssize_t got = read(output_fd, buffer, sizeof(buffer));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return OutputClosedError();
      text.append(buffer, static_cast<size_t>(got));
    }
    return absl::OkStatus();
  }

  void PrintNotice() const {
    std::fprintf(stderr,
                 "the %s (process %d) has not listened for %s; still waiting. Its messages: %s\n",
                 options_.description.c_str(), pid_,
                 absl::FormatDuration(options_.start_notice).c_str(), StderrFile().c_str());
  }

  // The error of a server that closed its stdout before it listened. An ending process frees its
  // memory before its descriptors, so it can be waited for soon after.
  absl::Status OutputClosedError() {
    if (EndedWithin(options_.stop_timeout)) return EndedError();
    return absl::UnavailableError(absl::StrCat(
        options_.description, " ", binary_, " closed its stdout before it listened", StderrTail()));
  }

  bool EndedWithin(absl::Duration timeout) {
    const auto deadline = Deadline(timeout);
    while (CheckAliveLocked().ok()) {
      if (std::chrono::steady_clock::now() >= deadline) return false;
      absl::SleepFor(absl::Milliseconds(2));
    }
    return true;
  }

  absl::Status CheckAliveLocked() {
    if (pid_ > 0 && !wait_status_) {
      int wait_status = 0;
      if (waitpid(pid_, &wait_status, WNOHANG) != pid_) return absl::OkStatus();
      wait_status_ = wait_status;
    }
    return EndedError();
  }

  absl::Status EndedError() const {
    return absl::UnavailableError(
        absl::StrCat("the ", options_.description, " that was started for this run ",
                     DescribeEnd(wait_status_.value_or(0)), StderrTail()));
  }

  std::string StderrFile() const { return folder_ + "/stderr.log"; }

  std::string StderrTail() const {
    std::ifstream file(StderrFile(), std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    std::string tail = text.str();
    if (tail.size() > kStderrTailBytes) tail = "..." + tail.substr(tail.size() - kStderrTailBytes);
    while (absl::EndsWith(tail, "\n")) tail.pop_back();
    return tail.empty() ? "; it wrote nothing to stderr" : "; its last messages:\n" + tail;
  }

  void Stop() {
    if (pid_ <= 0) return;
    if (!wait_status_) {
      kill(pid_, SIGTERM);
      lifeline_.Reset();
      if (!EndedWithin(options_.stop_timeout)) {
        int wait_status = 0;
        kill(pid_, SIGKILL);
        waitpid(pid_, &wait_status, 0);
        wait_status_ = wait_status;
      }
    }
    lifeline_.Reset();
    pid_ = -1;
  }

  const EmbeddedServerOptions options_;
  const std::string binary_;
  const ProcessFolder owned_folder_;
  const std::string folder_;
  const std::string address_;
  mutable std::mutex mutex_;
  pid_t pid_ = -1;
  std::optional<int> wait_status_;
  bool restarted_ = false;
  bool was_killed_at_start_ = false;
  ScopedFd lifeline_;  // the server ends when this is closed
};

}  // namespace

absl::StatusOr<std::unique_ptr<EmbeddedServer>> EmbeddedServer::Start(
    EmbeddedServerOptions options) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string binary, FindBinary(options));
  SIGHTLINE_ASSIGN_OR_RETURN(ProcessFolder folder, MakePrivateFolder());
  auto server = std::make_unique<EmbeddedServerImpl>(std::move(options), binary, std::move(folder));
  SIGHTLINE_RETURN_IF_ERROR(server->Start());
  return server;
}

}  // namespace sightline
