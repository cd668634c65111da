// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/command_program.h"

#include <algorithm>
#include <cassert>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <utility>
#include <vector>

#include "core/process/out_of_memory.h"
#include "core/trace/trace_context.h"
#include "planner_client/command_line/command_table.h"
#include "planner_client/command_line/global_options.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/parent_watch.h"
#include "planner_client/command_line/process/progress_line.h"

namespace sightline {

int RunCommandProgram(int argc, char** argv, std::string_view program,
                      std::span<const ProgramCommand> commands) {
  ReportOutOfMemory("sightline");
  CLI::App app;
  GlobalOptions options;
  SetUpCommandLine(app, std::string(program), &options);
  std::vector<std::pair<CLI::App*, Command>> added;
  for (const ProgramCommand& command : commands) {
    const auto* const entry =
        std::find_if(kCommands.begin(), kCommands.end(),
                     [&](const CommandEntry& known) { return known.name == command.name; });
    assert(entry != kCommands.end() && entry->program == program);
    CLI::App* const subcommand =
        app.add_subcommand(std::string(entry->name), std::string(entry->description));
    added.emplace_back(subcommand, command.add(*subcommand));
  }
  AddHelpExamples(app);
  if (argc < 2) {
    std::fputs(ShortHelp().c_str(), stderr);
    return kExitWrongInput;
  }
  if (const int code = ParseCommandLine(app, {argv + 1, argv + argc}); code >= 0) return code;
  if (options.progress == "json") UseJsonProgress();
  // The specification treats an invalid one as missing.
  const std::string traceparent = ValidTraceparent(options.traceparent);
  SetProcessTraceparent(traceparent.empty() ? NewTraceparent() : traceparent);
  if (!options.step_cache.empty()) setenv(kStepCacheEnvironment, options.step_cache.c_str(), 1);
  if (options.parent_fd >= 0) {
    if (absl::Status watched = EndWithParent(options.parent_fd); !watched.ok()) {
      return ReportError(watched);
    }
  }
  for (const auto& [subcommand, command] : added) {
    if (!subcommand->parsed()) continue;
    try {
      return command();
    } catch (const std::bad_alloc&) {
      return ReportError(absl::ResourceExhaustedError("out of memory"));
    }
  }
  return kExitWrongInput;
}

}  // namespace sightline
