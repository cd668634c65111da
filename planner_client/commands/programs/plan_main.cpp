// SPDX-License-Identifier: Apache-2.0
// sightline-plan: the commands that plan scans, and that prepare and judge plans.
#include <array>

#include "planner_client/command_line/command_program.h"
#include "planner_client/command_line/command_table.h"
#include "planner_client/commands/commands.h"

int main(int argc, char** argv) {
  constexpr std::array<sightline::ProgramCommand, 7> kOwn = {{
      {"new", sightline::AddNewCommand},
      {"plan", sightline::AddPlanCommand},
      {"evaluate", sightline::AddEvaluateCommand},
      {"compare", sightline::AddCompareCommand},
      {"part", sightline::AddPartCommand},
      {"calibrate", sightline::AddCalibrateCommand},
      {"inspect", sightline::AddInspectCommand},
  }};
  return sightline::RunCommandProgram(argc, argv, sightline::kPlanProgram, kOwn);
}
