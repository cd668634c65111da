// SPDX-License-Identifier: Apache-2.0
#include "bench/common/server_process.h"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "bench/common/measure.h"

namespace sightline::bench {

ServerProcess::ServerProcess(const std::string& listen) {
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "coverage_server";
  int out[2];
  if (pipe(out) != 0) Fail("server", "no pipe");
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(out[1], 1);
    close(out[0]);
    close(out[1]);
    execl(program.c_str(), program.c_str(), "--listen", listen.c_str(), "--log-level", "warning",
          nullptr);
    _exit(127);
  }
  close(out[1]);
  std::string text;
  char c;
  while (read(out[0], &c, 1) == 1 && c != '\n') text += c;
  close(out[0]);
  const std::string prefix = "listening on ";
  if (!text.starts_with(prefix)) Fail("server", program + " did not start: " + text);
  address_ = text.substr(prefix.size());
}

ServerProcess::~ServerProcess() {
  kill(pid_, SIGTERM);
  waitpid(pid_, nullptr, 0);
}

}  // namespace sightline::bench
