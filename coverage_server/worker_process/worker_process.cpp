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

#include "absl/strings/str_cat.h"

extern char** environ;

namespace sightline {

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
  pid_t pid = 0;
  const int error = posix_spawn(&pid, program.c_str(), &actions, nullptr, argv.data(), environ);
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

void EndWithParent() { prctl(PR_SET_PDEATHSIG, SIGKILL); }

}  // namespace sightline
