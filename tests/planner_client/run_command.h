// SPDX-License-Identifier: Apache-2.0
// A subcommand in this process.
#pragma once

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/commands/commands.h"

namespace sightline {

struct CommandResult {
  int exit_code;
  std::string output, errors;
};

inline CommandResult RunCommand(const std::function<Command(CLI::App&)>& add,
                                const std::vector<std::string>& arguments) {
  CLI::App app;
  const Command run = add(app);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  int exit_code = kExitWrongInput;
  try {
    app.parse(reversed);
    exit_code = run();
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error) == 0 ? kExitDone : kExitWrongInput;
  }
  std::string output = testing::internal::GetCapturedStdout();
  return {exit_code, std::move(output), testing::internal::GetCapturedStderr()};
}

}  // namespace sightline
