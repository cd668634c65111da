// SPDX-License-Identifier: Apache-2.0
// The subcommands of `sightline`. Each adds its options to the application and returns what to run:
// a function that returns the exit code.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace sightline {

using Command = std::function<int()>;

Command AddPlanCommand(CLI::App& app);
Command AddEvaluateCommand(CLI::App& app);
Command AddCompareCommand(CLI::App& app);
Command AddPartCommand(CLI::App& app);
Command AddRenderCommand(CLI::App& app);
Command AddOpticsCommand(CLI::App& app);
Command AddDiagnoseCommand(CLI::App& app);
Command AddRecordingsCommand(CLI::App& app);
Command AddVerifyCommand(CLI::App& app);
Command AddExploreCommand(CLI::App& app);
Command AddServeCommand(CLI::App& app);
Command AddBackupCommand(CLI::App& app);

}  // namespace sightline
