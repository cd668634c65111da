// SPDX-License-Identifier: Apache-2.0
// sightline-serve: the commands that answer HTTP, and the backup of the data of `serve`.
#include <array>

#include "planner_client/command_line/command_program.h"
#include "planner_client/command_line/command_table.h"
#include "planner_client/commands/commands.h"

int main(int argc, char** argv) {
  constexpr std::array<sightline::ProgramCommand, 3> kOwn = {{
      {"explore", sightline::AddExploreCommand},
      {"serve", sightline::AddServeCommand},
      {"backup", sightline::AddBackupCommand},
  }};
  return sightline::RunCommandProgram(argc, argv, sightline::kServeProgram, kOwn);
}
