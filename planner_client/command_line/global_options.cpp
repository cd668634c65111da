// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/global_options.h"

#include <algorithm>
#include <cstdio>
#include <memory>

#include "core/command_options/option_values.h"
#include "core/version/version.h"
#include "planner_client/command_line/help/help_format.h"
#include "planner_client/command_line/help/wrong_arguments.h"
#include "planner_client/command_line/process/exit_code.h"

namespace sightline {
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

void SetUpCommandLine(CLI::App& app, const std::string& program, GlobalOptions* options) {
  app.name("sightline");
  app.description(kAbout);
  app.formatter(std::make_shared<HelpFormat>());
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", VersionText(program));
  app.require_subcommand(1);
  app.add_option("--progress", options->progress,
                 "form of progress and errors on stderr: text, or json for programs, an object a "
                 "line")
      ->check(CLI::IsMember({"text", "json"}));
  app.add_option("--parent-fd", options->parent_fd,
                 "read end of a pipe; the command ends when its other end is closed");
  app.add_option("--traceparent", options->traceparent,
                 "W3C trace context of the request that this command is part of, for the logs of "
                 "servers; default: a new one")
      ->envname("TRACEPARENT");
  app.add_option("--step-cache", options->step_cache,
                 "folder in which meshes of STEP files are kept; default: sightline/step in the "
                 "user's cache")
      ->envname(kStepCacheEnvironment);
}

void AddHelpExamples(CLI::App& app) { app.footer(kExamples); }

std::string ShortHelp() {
  return std::string(kAbout) + "\n\n" + kExamples + "\n\n`sightline --help` lists all commands.\n";
}

int ParseCommandLine(CLI::App& app, const std::vector<std::string>& words) {
  RequireStrictNumbers(app);
  try {
    // CLI11 takes the words from the end.
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::Success& asked) {
    return app.exit(asked);  // --help, --version
  } catch (const CLI::ParseError& error) {
    std::fputs(ExplainWrongArguments(app, words, error).c_str(), stderr);
    return kExitWrongInput;
  }
  return -1;
}

}  // namespace sightline
