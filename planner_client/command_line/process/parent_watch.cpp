// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/parent_watch.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <thread>

#include "absl/strings/str_cat.h"
#include "planner_client/command_line/process/exit_code.h"

namespace sightline {

absl::Status EndWithParent(int read_end) {
  // Children must not inherit it: they have their own pipes.
  if (fcntl(read_end, F_SETFD, FD_CLOEXEC) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--parent-fd ", read_end, ": not an open file descriptor"));
  }
  std::thread([read_end] {
    char byte;
    while (true) {
      const ssize_t got = read(read_end, &byte, 1);
      if (got > 0 || (got < 0 && errno == EINTR)) continue;
      std::_Exit(kExitFailed);
    }
  }).detach();
  return absl::OkStatus();
}

}  // namespace sightline
