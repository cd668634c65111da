// SPDX-License-Identifier: Apache-2.0
// Programs of the build as processes, run by a shell.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <string>

namespace sightline {

// Folder of the running test, which has the programs beside it.
inline std::string BinFolder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

struct ProcessResult {
  int exit_code;
  std::string output;
};

// Runs a command line; stdout and stderr together.
inline ProcessResult RunProcess(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  ProcessResult result{};
  char buffer[512];
  while (fgets(buffer, sizeof(buffer), pipe) != nullptr) result.output += buffer;
  result.exit_code = WEXITSTATUS(pclose(pipe));
  return result;
}

}  // namespace sightline
