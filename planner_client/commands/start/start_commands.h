// SPDX-License-Identifier: Apache-2.0
// The subcommands that a new user begins with; as those of commands.h.
#pragma once

#include "planner_client/commands/commands.h"

namespace sightline {

Command AddNewCommand(CLI::App& app);
Command AddEffectsCommand(CLI::App& app);

}  // namespace sightline
