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

// Parses the command line, runs the command that it names and returns the exit code. Progress and
// errors have the form that the options before the command ask for; out of memory is an error like
// others. `program`: its name for --version, such as "sightline-plan"; all other texts speak of
// `sightline`, which is what people type.
int RunCommandProgram(int argc, char** argv, std::string_view program,
                      std::span<const ProgramCommand> commands);

}  // namespace sightline
