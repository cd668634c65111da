// SPDX-License-Identifier: Apache-2.0
// Meshes of STEP files, made once and cached.
//
// The key of a cached mesh is the SHA-256 of everything it depends on: the meshed bytes, the
// options, and the importer's program. Every entry contains the digest of its own content; an entry
// that does not match it is made again.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/part_files/step_program.h"

namespace sightline {

// Environment variable with the folder of cached meshes. A planning service sets it for its jobs,
// to a folder below its data.
inline constexpr char kStepCacheVariable[] = "SIGHTLINE_STEP_CACHE";

struct StepMeshOptions {
  StepProgramOptions program;
  // Length unit for a file that states none: m, cm, mm, um, inch. If empty, such a file is
  // rejected.
  std::string unit;
  // Use construction geometry as the part (tools/step_import/model/part_items.h).
  bool construction_geometry = false;
  // Folder of cached meshes. If empty: $SIGHTLINE_STEP_CACHE, else
  // $XDG_CACHE_HOME/sightline/step, else ~/.cache/sightline/step; if none of the latter is
  // usable, a folder of this process that is removed when it ends. Folder and entries are private
  // to this user (modes 0700 and 0600).
  std::string cache_folder;
};

struct StepMesh {
  std::string file;  // a GLB in metres, coordinates as modelled
  std::string glb;   // its bytes, already checked
  // Sentences for people: geometry of the STEP file that is not in the mesh, and damage to the kept
  // mesh.
  std::vector<std::string> remarks;
};

// The mesh that sightline_step_import makes of a STEP file. Processes that request the
// same mesh wait for the first one. Meshes unused for 30 days are removed. NOT_FOUND:
// no such file. INVALID_ARGUMENT: also for an unusable folder. Errors of
// RunStepImport.
absl::StatusOr<StepMesh> MeshOfStepFile(const std::string& file,
                                        const StepMeshOptions& options = {});

}  // namespace sightline
