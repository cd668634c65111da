// SPDX-License-Identifier: Apache-2.0
// The commands of `sightline`. Each function adds the options of its command to `app` and returns
// the command.
#pragma once

#include <CLI/CLI.hpp>

#include "planner_client/command_line/command.h"

namespace sightline {

Command AddNewCommand(CLI::App& app);
Command AddPlanCommand(CLI::App& app);
Command AddEvaluateCommand(CLI::App& app);
Command AddCompareCommand(CLI::App& app);
Command AddCalibrateCommand(CLI::App& app);
Command AddInspectCommand(CLI::App& app);
Command AddAcceptCommand(CLI::App& app);
Command AddPartCommand(CLI::App& app);
Command AddRenderCommand(CLI::App& app);
Command AddEffectsCommand(CLI::App& app);
Command AddOpticsCommand(CLI::App& app);
Command AddDiagnoseCommand(CLI::App& app);
Command AddRecordingsCommand(CLI::App& app);
Command AddVerifyCommand(CLI::App& app);
Command AddExploreCommand(CLI::App& app);
Command AddServeCommand(CLI::App& app);
Command AddBackupCommand(CLI::App& app);

}  // namespace sightline
