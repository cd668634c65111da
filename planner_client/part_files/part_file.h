// SPDX-License-Identifier: Apache-2.0
// Part files: the formats of core/part, and STEP.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"

namespace sightline {

// Suffixes of part files as a list for people: ".step, .stp, .glb, ...".
std::string PartFileEndings();

struct PartFileOptions {
  // Use construction geometry as the part. INVALID_ARGUMENT for a file that is not STEP.
  bool construction_geometry = false;
  // Receives remarks on content of the file that is not in the part, and on choices that
  // the file leaves open. If null, remarks are written to stderr, so that no omission is
  // silent.
  std::vector<std::string>* remarks = nullptr;
};

struct MeshFile {
  std::string path;
  std::string unit;  // unit of lengths; empty if the format defines it
};

// The file itself, or the mesh of a STEP file (step_mesh.h). `unit` as for LoadPartFile.
absl::StatusOr<MeshFile> MeshFileOf(const std::string& path, const std::string& unit,
                                    const PartFileOptions& options = {});

// LoadPart, extended to STEP files. `unit` is required if a STEP file states none, and rejected if
// it states one. Messages name `path`.
absl::StatusOr<TriangleMesh> LoadPartFile(const std::string& path, const std::string& unit,
                                          const PartFileOptions& options = {});

// True if a unit must be given for this file: its format, or this STEP file, states none. False
// also for a file that cannot be read.
bool NeedsPartUnit(const std::string& path);

}  // namespace sightline
