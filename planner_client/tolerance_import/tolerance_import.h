// SPDX-License-Identifier: Apache-2.0
// Reads tolerances of a drawing from a STEP (AP242) or QIF 3.0 file.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/part/mesh.h"
#include "core/tolerance/face_surface.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

struct ToleranceImportOptions {
  // Folder of the QIF 3.0 schema for validation of QIF files; if empty, they are not validated.
  std::string qif_schema_folder;
  // Unit of lengths for a QIF or STEP file that states none: "m", "cm", "mm", "um", "inch". If
  // empty, such a file is rejected.
  std::string length_unit;
  // The program that reads STEP. Empty: sightline_step_import beside the running program, or in
  // PATH.
  std::string step_import_program;
  // Time limit of that program.
  absl::Duration time_limit = absl::Minutes(10);
};

struct ImportedTolerances {
  ToleranceReport report;
  // Triangles of the STEP file's faces, in metres in its coordinates, which are those of the GLB
  // that sightline_step_import makes of it. Empty for QIF, whose features have nominal geometry.
  std::vector<FaceTriangles> faces;
};

// The faces that the tolerances name, by number: those of a STEP file, or faces of the part's
// mesh on the features of a QIF file. `part` is in the coordinates of the file.
// INVALID_ARGUMENT: the QIF file describes features, but no surface of the part lies on any of
// them.
absl::StatusOr<std::vector<FaceTriangles>> FacesOf(const ImportedTolerances& imported,
                                                   const TriangleMesh& part);

// Chooses the reader by the file's suffix: .stp, .step, .p21 or .qif, in any case. STEP is read by
// another program, to keep OpenCASCADE out of this one. A file without tolerances is no error: the
// report's entity_count is 0.
//
// INVALID_ARGUMENT: another suffix, or the file is wrong (the message names it). NOT_FOUND: no such
// file, no such program (build target sightline_step_import). DEADLINE_EXCEEDED, INTERNAL: the
// program took too long or failed; the message ends with its stderr.
absl::StatusOr<ImportedTolerances> ImportTolerances(const std::string& file,
                                                    const ToleranceImportOptions& options = {});

}  // namespace sightline
