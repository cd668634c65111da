// SPDX-License-Identifier: Apache-2.0
// Meshes of STEP files, made once and kept.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/part_files/step_program.h"

namespace sightline {

struct StepMeshOptions {
  StepProgramOptions program;
  // Where meshes are kept. Empty: $XDG_CACHE_HOME/sightline/step, else ~/.cache/sightline/step;
  // where none of these can be written, a folder of this process, gone when it ends.
  std::string cache_folder;
};

// Path of a GLB in metres, coordinates as modelled, which sightline_step_import makes of the STEP
// file. It is made anew where the file's bytes or the importer have changed; processes that ask for
// the same one wait for the first. Meshes that nobody has asked for in 30 days are removed.
// NOT_FOUND: no such file. Errors of RunStepImport.
absl::StatusOr<std::string> MeshOfStepFile(const std::string& file,
                                           const StepMeshOptions& options = {});

}  // namespace sightline
