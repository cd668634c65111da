// SPDX-License-Identifier: Apache-2.0
// Options before the command on the command line of `sightline`. The dispatcher and the programs
// that run commands read the same options.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace sightline {

// Environment variable for --step-cache; planner_client/part_files/step_mesh.h reads it.
inline constexpr char kStepCacheEnvironment[] = "SIGHTLINE_STEP_CACHE";

// Options before the command.
struct GlobalOptions {
  std::string progress = "text";  // or "json"
  int parent_fd = -1;             // -1: none
  std::string traceparent;        // W3C trace context; empty: none
  std::string step_cache;         // folder of meshes of STEP files; empty: the user's cache
};

// Sets name, description, form of --help, --version (which names `program`) and the options.
// `options` must outlive `app`. Call AddHelpExamples() once all commands are added.
void SetUpCommandLine(CLI::App& app, const std::string& program, GlobalOptions* options);

// Adds examples at the end of `sightline --help`. Commands copy the footer that is set when they
// are added, so call this last.
void AddHelpExamples(CLI::App& app);

// The text that `sightline` prints if it is started without arguments.
std::string ShortHelp();

// Parses `words`, the command line without the program's name. Returns -1 to continue, or the exit
// code if the process should end, as after --help or a wrong option (explained on stderr).
int ParseCommandLine(CLI::App& app, const std::vector<std::string>& words);

}  // namespace sightline
