// sightline: plans machine-vision inspection by simulation.
#include <CLI/CLI.hpp>
#include <utility>
#include <vector>

#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"

int main(int argc, char** argv) {
  CLI::App app{"Sightline plans machine-vision inspection by simulation."};
  app.set_version_flag("--version", SIGHTLINE_VERSION);
  app.require_subcommand(1);
  std::vector<std::pair<CLI::App*, sightline::Command>> commands;
  const auto add = [&](const char* name, const char* description, auto&& add_command) {
    CLI::App* subcommand = app.add_subcommand(name, description);
    commands.emplace_back(subcommand, add_command(*subcommand));
  };
  add("plan", "find the few scans that measure the part's surface", sightline::AddPlanCommand);
  add("evaluate", "exact coverage of a given plan", sightline::AddEvaluateCommand);
  add("compare", "planning strategies side by side", sightline::AddCompareCommand);
  add("part", "health report of a part file", sightline::AddPartCommand);
  add("render", "what the camera would record", sightline::AddRenderCommand);
  add("optics", "f-number, exposure and focus with which the line is found best",
      sightline::AddOpticsCommand);
  add("recordings", "shot list for recordings, and their check", sightline::AddRecordingsCommand);
  add("verify", "recordings of a plate next to their simulation", sightline::AddVerifyCommand);
  add("diagnose", "what the description of recordings leaves out", sightline::AddDiagnoseCommand);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? sightline::kExitDone : sightline::kExitWrongInput;
  }
  for (const auto& [subcommand, command] : commands) {
    if (subcommand->parsed()) return command();
  }
  return sightline::kExitWrongInput;
}
