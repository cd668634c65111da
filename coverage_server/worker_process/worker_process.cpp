// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/worker_process/worker_process.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/process/program_path.h"
#include "core/process/start_process.h"

namespace sightline {

std::string WorkerProgram() {
  std::vector<std::filesystem::path> programs = {FindProgram("coverage_server")};
  if (const char* folder = std::getenv("SIGHTLINE_BIN_DIR")) {
    programs.push_back(std::filesystem::path(folder) / "coverage_server");
  }
  for (const std::filesystem::path& program : programs) {
    if (access(program.c_str(), X_OK) == 0) return program.string();
  }
  return "";
}

absl::StatusOr<WorkerProcess> WorkerProcess::Start(const std::string& program,
                                                   std::vector<std::string> arguments,
                                                   std::span<const int> descriptors) {
  ProcessStart start{.words = std::move(arguments), .in_our_group = true, .ends_with_us = true};
  start.words.insert(start.words.begin(), program);
  for (const int fd : descriptors) start.descriptors.push_back({.number = fd, .ours = fd});
  const absl::StatusOr<pid_t> pid = StartProcess(start);
  if (!pid.ok()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("a worker process: ", std::string(pid.status().message())));
  }
  return WorkerProcess(*pid);
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

}  // namespace sightline
