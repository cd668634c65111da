// SPDX-License-Identifier: Apache-2.0
#include "core/process/start_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// In the environment of a program that ends with us: this process.
constexpr char kParentPid[] = "SIGHTLINE_PARENT_PID";

// This process's environment with other variables, "NAME=VALUE". Only they say who started it.
std::vector<char*> EnvironmentWith(std::vector<std::string>* others) {
  std::vector<char*> variables;
  const auto is_replaced = [&](absl::string_view variable) {
    return absl::StartsWith(variable, absl::StrCat(kParentPid, "=")) ||
           std::any_of(others->begin(), others->end(), [&](const std::string& other) {
             return absl::StartsWith(variable, other.substr(0, other.find('=') + 1));
           });
  };
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (!is_replaced(*variable)) variables.push_back(*variable);
  }
  for (std::string& other : *others) variables.push_back(other.data());
  variables.push_back(nullptr);
  return variables;
}

absl::Status CannotStart(const ProcessStart& start, int error) {
  return absl::UnavailableError(
      absl::StrCat("cannot start ", start.words.at(0), ": ", std::strerror(error)));
}

}  // namespace

absl::StatusOr<pid_t> StartProcess(const ProcessStart& start) {
  std::vector<std::string> words = start.words;
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  std::vector<int> copies;
  const auto clean_up = absl::MakeCleanup([&] {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    for (const int fd : copies) close(fd);
  });

  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  int highest = 2;
  for (const auto& descriptor : start.descriptors) highest = std::max(highest, descriptor.number);
  for (const auto& descriptor : start.descriptors) {
    if (descriptor.ours < 0) {
      posix_spawn_file_actions_addopen(&actions, descriptor.number, descriptor.file.c_str(),
                                       descriptor.flags, 0600);
      continue;
    }
    // A copy above all numbers that are filled: none is overwritten before it is moved, and dup2
    // onto another number clears close-on-exec.
    const int copy = fcntl(descriptor.ours, F_DUPFD_CLOEXEC, highest + 1);
    if (copy < 0) return CannotStart(start, errno);
    copies.push_back(copy);
    posix_spawn_file_actions_adddup2(&actions, copy, descriptor.number);
  }
  if (!start.folder.empty()) {
    posix_spawn_file_actions_addchdir_np(&actions, start.folder.c_str());
  }
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  const int group = start.in_our_group ? 0 : POSIX_SPAWN_SETPGROUP;
  posix_spawnattr_setflags(
      &attributes, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | group));
  std::vector<std::string> others = start.environment;
  if (start.ends_with_us) others.push_back(absl::StrCat(kParentPid, "=", getpid()));
  const std::vector<char*> environment = EnvironmentWith(&others);
  pid_t pid = -1;
  const int error = (start.in_path ? posix_spawnp : posix_spawn)(
      &pid, argv[0], &actions, &attributes, argv.data(), environment.data());
  if (error != 0) return CannotStart(start, error);
  return pid;
}

void EndWithParent() {
  const char* const parent = std::getenv(kParentPid);
  pid_t pid = 0;
  if (parent == nullptr || !absl::SimpleAtoi(parent, &pid)) return;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // If the parent ended earlier, its signal never arrives: this process belongs to another by now.
  // The order matters, or the parent could go between the two.
  if (pid != getppid()) raise(SIGKILL);
}

}  // namespace sightline
