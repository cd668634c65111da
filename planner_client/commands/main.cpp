// SPDX-License-Identifier: Apache-2.0
// sightline: plans machine-vision inspection by simulation.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/process/out_of_memory.h"
#include "core/trace/trace_context.h"
#include "core/version/version.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/help/help_format.h"
#include "planner_client/commands/help/wrong_arguments.h"
#include "planner_client/commands/process/exit_code.h"
#include "planner_client/commands/process/parent_watch.h"
#include "planner_client/commands/process/progress_line.h"
#include "planner_client/commands/start/start_commands.h"

namespace {

constexpr char kAbout[] = "Sightline plans machine-vision inspection by simulation.";
constexpr char kExamples[] =
    "Examples:\n"
    "  sightline new bracket.step               writes inspection.json for the part\n"
    "  sightline plan inspection.json --out plan\n"
    "                                           which scans measure it; see\n"
    "                                           plan/report.html\n"
    "  sightline part bracket.stl --unit mm     is the mesh sound?\n"
    "  sightline effects                        what images can be made to show";

}  // namespace

int main(int argc, char** argv) {
  sightline::ReportOutOfMemory("sightline");
  CLI::App app{kAbout, "sightline"};
  app.formatter(std::make_shared<sightline::HelpFormat>());
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", sightline::VersionText("sightline"));
  app.require_subcommand(1);
  std::string progress = "text";
  app.add_option("--progress", progress,
                 "form of progress and errors on stderr: text, or json for programs, an object a "
                 "line")
      ->check(CLI::IsMember({"text", "json"}));
  int parent_fd = -1;
  app.add_option("--parent-fd", parent_fd,
                 "read end of a pipe; the command ends when its other end is closed");
  std::string traceparent;
  app.add_option("--traceparent", traceparent,
                 "W3C trace context of the request that this command is part of, for the logs of "
                 "servers; default: a new one")
      ->envname("TRACEPARENT");
  std::vector<std::pair<CLI::App*, sightline::Command>> commands;
  const auto add = [&](const char* name, const char* description, auto&& add_command) {
    CLI::App* subcommand = app.add_subcommand(name, description);
    commands.emplace_back(subcommand, add_command(*subcommand));
  };
  add("new", "an inspection.json for a part, with values that suit it", sightline::AddNewCommand);
  add("plan", "find the few scans that measure the part's surface", sightline::AddPlanCommand);
  add("evaluate", "exact coverage of a given plan", sightline::AddEvaluateCommand);
  add("compare", "planning strategies side by side", sightline::AddCompareCommand);
  add("part", "health report of a part file", sightline::AddPartCommand);
  add("render", "what the camera would record", sightline::AddRenderCommand);
  add("effects", "physical effects that images can show, with their parameters",
      sightline::AddEffectsCommand);
  add("optics", "f-number, exposure and focus with which the line is found best",
      sightline::AddOpticsCommand);
  add("recordings", "shot list for recordings, and their check", sightline::AddRecordingsCommand);
  add("verify", "recordings of a plate next to their simulation", sightline::AddVerifyCommand);
  add("diagnose", "what the description of recordings leaves out", sightline::AddDiagnoseCommand);
  add("explore", "scans by hand on a local web page: their gain and what the camera would record",
      sightline::AddExploreCommand);
  add("serve", "planning jobs for remote clients: gRPC, HTTP and a web page",
      sightline::AddServeCommand);
  add("backup", "copy of the planning service's data folder, while it runs",
      sightline::AddBackupCommand);
  app.footer(kExamples);  // of this help only: commands take the footer that is there before them
  if (argc < 2) {
    std::fprintf(stderr, "%s\n\n%s\n\n`sightline --help` lists all commands.\n", kAbout, kExamples);
    return sightline::kExitWrongInput;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& asked) {
    return app.exit(asked);  // --help, --version
  } catch (const CLI::ParseError& error) {
    const std::string explained =
        sightline::ExplainWrongArguments(app, {argv + 1, argv + argc}, error);
    std::fputs(explained.c_str(), stderr);
    return sightline::kExitWrongInput;
  }
  if (progress == "json") sightline::UseJsonProgress();
  // One that is not valid counts as none, as the specification has it.
  traceparent = sightline::ValidTraceparent(traceparent);
  sightline::SetProcessTraceparent(traceparent.empty() ? sightline::NewTraceparent() : traceparent);
  if (parent_fd >= 0) {
    if (absl::Status watched = sightline::EndWithParent(parent_fd); !watched.ok()) {
      return sightline::ReportError(watched);
    }
  }
  for (const auto& [subcommand, command] : commands) {
    if (!subcommand->parsed()) continue;
    try {
      return command();
    } catch (const std::bad_alloc&) {
      return sightline::ReportError(absl::ResourceExhaustedError("out of memory"));
    }
  }
  return sightline::kExitWrongInput;
}
