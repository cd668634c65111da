// SPDX-License-Identifier: Apache-2.0
// sightline-render: the commands that simulate images, choose optics, test rigs and compare
// recordings.
#include <array>

#include "planner_client/command_line/command_program.h"
#include "planner_client/command_line/command_table.h"
#include "planner_client/commands/commands.h"

int main(int argc, char** argv) {
  constexpr std::array<sightline::ProgramCommand, 7> kOwn = {{
      {"accept", sightline::AddAcceptCommand},
      {"render", sightline::AddRenderCommand},
      {"effects", sightline::AddEffectsCommand},
      {"optics", sightline::AddOpticsCommand},
      {"recordings", sightline::AddRecordingsCommand},
      {"verify", sightline::AddVerifyCommand},
      {"diagnose", sightline::AddDiagnoseCommand},
  }};
  return sightline::RunCommandProgram(argc, argv, sightline::kRenderProgram, kOwn);
}
