// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>
#include <vector>

#include "core/trace/trace_context.h"
#include "planner_client/commands/commands.h"
#include "planning_service/server/planning_server.h"

namespace sightline {

Command AddServeCommand(CLI::App& app) {
  // The server reads its own arguments, as the other servers do.
  app.prefix_command();
  app.set_help_flag();
  return [&app] {
    // It handles requests of many clients.
    SetProcessTraceparent("");
    std::vector<std::string> words = {"sightline serve"};
    for (const std::string& word : app.remaining()) words.push_back(word);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    return PlanningServerMain(static_cast<int>(argv.size()), argv.data());
  };
}

}  // namespace sightline
