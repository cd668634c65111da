// SPDX-License-Identifier: Apache-2.0
// The commands of `sightline` and the programs that run them. `sightline` itself only finds the
// program of a command and executes it (exec), so planning needs no renderer.
#pragma once

#include <array>
#include <string_view>

namespace sightline {

struct CommandEntry {
  std::string_view name;
  std::string_view program;
  std::string_view description;  // one line of `sightline --help`
};

inline constexpr std::string_view kPlanProgram = "sightline-plan";
inline constexpr std::string_view kRenderProgram = "sightline-render";
inline constexpr std::string_view kServeProgram = "sightline-serve";

// Entries in the order of `sightline --help`.
inline constexpr std::array<CommandEntry, 17> kCommands = {{
    {"new", kPlanProgram, "an inspection.json for a part, with values that suit it"},
    {"plan", kPlanProgram, "find the few scans that measure the part's surface"},
    {"evaluate", kPlanProgram, "exact coverage of a given plan"},
    {"compare", kPlanProgram, "planning strategies side by side"},
    {"part", kPlanProgram, "health report of a part file"},
    {"calibrate", kPlanProgram, "a real scanner from frames of its line on a checkerboard"},
    {"inspect", kPlanProgram, "whether a part conforms, from the points that its scans measured"},
    {"accept", kRenderProgram, "acceptance test of the rig by simulated artefacts"},
    {"render", kRenderProgram, "what the camera would record"},
    {"effects", kRenderProgram, "physical effects that images can show, with their parameters"},
    {"optics", kRenderProgram, "f-number, exposure and focus with which the line is found best"},
    {"recordings", kRenderProgram, "shot list for recordings, and their check"},
    {"verify", kRenderProgram, "recordings of a plate next to their simulation"},
    {"diagnose", kRenderProgram, "what the description of recordings leaves out"},
    {"explore", kServeProgram,
     "scans by hand on a local web page: their gain and what the camera would record"},
    {"serve", kServeProgram, "planning jobs for remote clients: gRPC, HTTP and a web page"},
    {"backup", kServeProgram, "copy of the planning service's data folder, while it runs"},
}};

}  // namespace sightline
