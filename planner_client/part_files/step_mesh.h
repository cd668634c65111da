// SPDX-License-Identifier: Apache-2.0
// Meshes of STEP files, made once and kept.
//
// The key of a kept mesh is the SHA-256 of everything it depends on: the bytes that were meshed,
// the options, and the importer's program. Every entry carries the digest of its own content; an
// entry that does not agree with it is made again.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/part_files/step_program.h"

namespace sightline {

// Environment variable that names the folder of kept meshes. A planning service sets it for its
// jobs, to a folder below its data.
inline constexpr char kStepCacheVariable[] = "SIGHTLINE_STEP_CACHE";

struct StepMeshOptions {
  StepProgramOptions program;
  // Length unit of a file that states none: m, cm, mm, um, inch. Empty: such a file is refused.
  std::string unit;
  // Take construction geometry for the part (tools/step_import/model/part_items.h).
  bool construction_geometry = false;
  // The folder of kept meshes. Empty: $SIGHTLINE_STEP_CACHE, else $XDG_CACHE_HOME/sightline/step,
  // else
  // ~/.cache/sightline/step; where none of the latter can be used, a folder of this process, gone
  // when it ends. The folder is made for this user alone (mode 0700), entries too (0600).
  std::string cache_folder;
};

struct StepMesh {
  std::string file;  // a GLB in metres, coordinates as modelled
  std::string glb;   // its bytes, as they were checked
  // Sentences for people: geometry of the STEP file that is not in the mesh, and damage to the kept
  // mesh.
  std::vector<std::string> remarks;
};

// The mesh that sightline_step_import makes of a STEP file. Processes that ask for the same one
// wait for the first. Meshes that were not used for 30 days are removed.
// NOT_FOUND: no such file. INVALID_ARGUMENT: also a folder that cannot be used. Errors of
// RunStepImport.
absl::StatusOr<StepMesh> MeshOfStepFile(const std::string& file,
                                        const StepMeshOptions& options = {});

}  // namespace sightline
