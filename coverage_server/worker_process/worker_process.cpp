// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/worker_process/worker_process.h"

#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

extern char** environ;

namespace sightline {
namespace {

// In a worker's environment: the process that started it.
constexpr char kParentPid[] = "SIGHTLINE_PARENT_PID";

// The environment of a worker: this one's, with the variable of its own.
std::vector<char*> WorkerEnvironment(std::string& parent_pid) {
  std::vector<char*> variables = {parent_pid.data()};
  const size_t name_bytes = sizeof(kParentPid);  // with the '=' behind the name
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (std::strncmp(*variable, parent_pid.c_str(), name_bytes) != 0) {
      variables.push_back(*variable);
    }
  }
  variables.push_back(nullptr);
  return variables;
}

}  // namespace

std::string WorkerProgram() {
  std::error_code ignored;
  std::vector<std::filesystem::path> folders = {
      std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path()};
  if (const char* folder = std::getenv("SIGHTLINE_BIN_DIR")) folders.emplace_back(folder);
  for (const auto& folder : folders) {
    const auto program = folder / "coverage_server";
    if (access(program.c_str(), X_OK) == 0) return program.string();
  }
  return "";
}

absl::StatusOr<WorkerProcess> WorkerProcess::Start(const std::string& program,
                                                   std::vector<std::string> arguments,
                                                   std::span<const int> descriptors) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  // dup2 onto itself drops close-on-exec for the child only.
  for (const int fd : descriptors) posix_spawn_file_actions_adddup2(&actions, fd, fd);
  std::string name = program;
  std::vector<char*> argv = {name.data()};
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  std::string parent_pid = absl::StrCat(kParentPid, "=", getpid());
  pid_t pid = 0;
  const int error = posix_spawn(&pid, program.c_str(), &actions, nullptr, argv.data(),
                                WorkerEnvironment(parent_pid).data());
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    return absl::ResourceExhaustedError(
        absl::StrCat("a worker process cannot be started: ", std::strerror(error)));
  }
  return WorkerProcess(pid);
}

WorkerProcess::~WorkerProcess() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

std::optional<int> WorkerProcess::Ended() {
  int state = 0;
  if (waitpid(pid_, &state, WNOHANG) != pid_) return std::nullopt;
  pid_ = 0;
  return state;
}

void EndWithParent() {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // Of a parent that went before, no signal comes any more: this process belongs to another by now.
  // The order matters, or the parent could go between the two.
  const char* const parent = std::getenv(kParentPid);
  pid_t pid = 0;
  if (parent != nullptr && absl::SimpleAtoi(parent, &pid) && pid != getppid()) raise(SIGKILL);
}

}  // namespace sightline
