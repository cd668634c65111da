// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/run_program.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace sightline {
namespace {

// The tolerances of half a million triangles take about 40 MB.
constexpr size_t kMaxOutputBytes = size_t{1} << 29;
constexpr size_t kStderrTailBytes = 2000;

class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() { Close(); }
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;
  int get() const { return fd_; }
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }

 private:
  int fd_;
};

// Kills the program and waits for it unless it has been waited for.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  ~Child() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    Wait();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  int Wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = 0;
    return status;
  }

 private:
  pid_t pid_;
};

absl::Status SystemError(const std::string& what) {
  return absl::InternalError(absl::StrCat(what, ": ", std::strerror(errno)));
}

}  // namespace

absl::StatusOr<FinishedProgram> RunProgram(const std::string& program,
                                           std::vector<std::string> arguments,
                                           absl::Duration time_limit) {
  std::array<int, 2> out{}, err{};
  if (pipe2(out.data(), O_CLOEXEC) != 0) return SystemError("pipe");
  Fd out_read(out[0]), out_write(out[1]);
  if (pipe2(err.data(), O_CLOEXEC) != 0) return SystemError("pipe");
  Fd err_read(err[0]), err_write(err[1]);

  arguments.insert(arguments.begin(), program);
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out_write.get(), 1);
  posix_spawn_file_actions_adddup2(&actions, err_write.get(), 2);
  pid_t pid = 0;
  const int failed = posix_spawn(&pid, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return absl::InternalError(absl::StrCat(program, ": ", std::strerror(failed)));
  }
  Child child(pid);
  out_write.Close();
  err_write.Close();

  FinishedProgram finished;
  const absl::Time deadline = absl::Now() + time_limit;
  std::array<pollfd, 2> polled = {{{out_read.get(), POLLIN, 0}, {err_read.get(), POLLIN, 0}}};
  std::array<std::string*, 2> sinks = {&finished.output, &finished.errors};
  std::vector<char> buffer(1 << 16);
  while (polled[0].fd >= 0 || polled[1].fd >= 0) {
    const int64_t left_ms = absl::ToInt64Milliseconds(deadline - absl::Now());
    if (left_ms <= 0) {
      return absl::DeadlineExceededError(absl::StrCat(
          program, " took longer than ", absl::FormatDuration(time_limit), " and was ended"));
    }
    const int ready =
        poll(polled.data(), polled.size(), static_cast<int>(std::min<int64_t>(left_ms, 1000)));
    if (ready < 0 && errno != EINTR) return SystemError("poll");
    if (ready <= 0) continue;
    for (size_t i = 0; i < polled.size(); ++i) {
      if (polled[i].fd < 0 || polled[i].revents == 0) continue;
      const ssize_t count = read(polled[i].fd, buffer.data(), buffer.size());
      if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (count <= 0) {
        polled[i].fd = -1;
        continue;
      }
      sinks[i]->append(buffer.data(), static_cast<size_t>(count));
      if (finished.output.size() > kMaxOutputBytes) {
        return absl::InternalError(absl::StrCat(program, " wrote more than 512 MiB"));
      }
      // What it wrote last tells why it failed.
      if (finished.errors.size() > 2 * kStderrTailBytes) {
        finished.errors.erase(0, finished.errors.size() - kStderrTailBytes);
      }
    }
  }
  finished.wait_status = child.Wait();
  return finished;
}

}  // namespace sightline
