// SPDX-License-Identifier: Apache-2.0
// The main function of a program that carries out a group of commands.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string_view>

#include "planner_client/command_line/command.h"

namespace sightline {

// A command of the program: its name in command_table.h, and the function that adds its options.
struct ProgramCommand {
  std::string_view name;
  Command (*add)(CLI::App& app);
};

// Parses the command line, runs the command that it names and returns the exit code. Global options
// before the command set the format of progress and errors. Out of memory is reported like any
// other error. `program`: name for --version, such as "sightline-plan"; all other texts say
// `sightline`, the command that people type.
int RunCommandProgram(int argc, char** argv, std::string_view program,
                      std::span<const ProgramCommand> commands);

}  // namespace sightline
